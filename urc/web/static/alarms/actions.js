// @ts-check
/**
 * An operator's requests about alarms, over HTTP. The server responds after it has stored the
 * change.
 *
 * @typedef {import("./book.js").AlarmRow} AlarmRow
 * @typedef {{signals: string[], stored: boolean}} ActionAnswer
 *
 * @typedef {object} AlarmEvent
 * @property {number} id
 * @property {number} at In seconds since 1970.
 * @property {string} signal
 * @property {string} title
 * @property {string} kind
 * @property {string} condition
 * @property {"low" | "medium" | "high"} priority
 * @property {string} value
 * @property {string} who
 * @property {number} until
 * @property {number} times
 */
import { ask } from "../core/api_client.js";

/** Choices for the duration of shelving, in minutes. */
export const SHELF_MINUTES = Object.freeze([10, 60, 480, 1440]);

export class AlarmActions {
  /** @param {string} path path of the robot's alarms in the API */
  constructor(path) {
    this.path = path;
  }

  /**
   * Acknowledge alarms in the state that the operator sees.
   *
   * @param {readonly Pick<AlarmRow, "signal" | "raised">[]} rows
   * @returns {Promise<ActionAnswer>}
   */
  acknowledge(rows) {
    const alarms = Object.fromEntries(rows.map(({ signal, raised }) => [signal, raised]));
    return ask(`${this.path}/acknowledge`, { alarms });
  }

  /**
   * @param {readonly string[]} signals
   * @param {number} minutes
   * @returns {Promise<ActionAnswer>}
   */
  shelve(signals, minutes) {
    return ask(`${this.path}/shelve`, { signals, for_s: 60 * minutes });
  }

  /**
   * @param {readonly string[]} signals
   * @returns {Promise<ActionAnswer>}
   */
  unshelve(signals) {
    return ask(`${this.path}/unshelve`, { signals });
  }

  /**
   * @param {{text: string, before: number, last: number}} query
   * @returns {Promise<{events: AlarmEvent[], has_more: boolean, fault: string, lost: number}>}
   */
  history({ text, before, last }) {
    const asked = new URLSearchParams({ last: String(last) });
    if (text) asked.set("text", text);
    if (before) asked.set("before", String(before));
    return ask(`${this.path}/history?${asked}`);
  }
}
