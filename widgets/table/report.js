// @ts-check
/**
 * The newest status of each diagnosed part, with its age. Pure.
 *
 * Several programs of a robot may publish diagnostics on the same topic, each about its own parts. A
 * list of statuses therefore adds to the known parts. All other forms of reports replace the last
 * report.
 *
 * @typedef {import("./rows.js").Row} Row
 */
import { MOST_ROWS, rowsOf } from "./rows.js";

/** Multiple of the largest age after which a part is removed. */
const GONE_AFTER = 10;

export class Report {
  constructor() {
    /** Status of each part, the newest last. @type {Map<string, {row: Row, time: number}>} */
    this.parts = new Map();
    /** Rows of the last report in another form. @type {Row[]} */
    this.others = [];
  }

  /**
   * Take a report; null removes all parts.
   *
   * @param {unknown} value
   * @param {number} time time of the report in seconds, on any clock
   */
  take(value, time) {
    if (value === null) this.parts.clear();
    const isList = typeof value === "object" && value !== null && Array.isArray(Reflect.get(value, "status"));
    this.others = isList ? [] : rowsOf(value);
    if (!isList) return;
    for (const row of rowsOf(value)) {
      this.parts.delete(row.name);
      this.parts.set(row.name, { row, time });
    }
    for (const name of this.parts.keys()) {
      if (this.parts.size <= MOST_ROWS) break;
      this.parts.delete(name);
    }
  }

  /**
   * Return the rows, with the age of each part that is too old.
   *
   * @param {number} now time in seconds, on the same clock
   * @param {number} limit largest age in seconds; 0 means no limit
   * @returns {Row[]}
   */
  rows(now, limit) {
    const rows = [...this.others];
    for (const [name, { row, time }] of this.parts) {
      const age = now - time;
      if (limit > 0 && age > GONE_AFTER * limit) this.parts.delete(name);
      else rows.push(limit > 0 && age > limit ? { ...row, level: "stale", age } : row);
    }
    return rows;
  }
}
