// @ts-check
/**
 * Why did it move? The audit log of one robot, newest first, loaded on demand.
 *
 * @typedef {object} Entry
 * @property {number} at UTC in seconds
 * @property {string} robot
 * @property {string} what
 * @property {string} who
 * @property {string} role
 * @property {string} client
 * @property {number} epoch
 * @property {string} command
 * @property {string} arguments JSON
 * @property {string} data hex, or a size and a hash
 * @property {string} outcome
 * @property {number} times
 * @property {number} lasted_s
 */
import { part } from "../live/badge.js";
import { element, visible, wordsOf } from "./bytes.js";

const MOST = 200;
const ANSWER_WITHIN_MS = 10_000;
/** A shape and a word each, because colour alone is not enough. @type {Record<string, string>} */
const SIGNS = {
  moved: "● moved",
  stopped: "■ stopped",
  refused: "▲ refused",
  lease: "◆ controls",
  STOP: "■ STOP",
  reset: "◆ reset",
  ran: "→ command",
  lost: "▲ lost",
};
/** @type {Record<string, string>} */
const LEVELS = { refused: "warning", lost: "error", STOP: "error" };

export class Timeline {
  /**
   * @param {ParentNode} root
   * @param {string} url
   */
  constructor(root, url) {
    this.url = url;
    this.list = part(root, "[data-why]");
    this.state = part(root, "[data-why-state]");
    this.isAsking = false;
    part(root, "[data-why-refresh]").addEventListener("click", () => this.refresh());
  }

  /** Reload; the old entries stay until the response arrives. */
  async refresh() {
    if (this.isAsking) return;
    this.isAsking = true;
    try {
      const { entries, fault } = await this.ask();
      this.list.replaceChildren(...entries.map(row));
      this.state.textContent = fault ? `▲ nothing new is kept: ${visible(fault)}` : told(entries);
    } catch (error) {
      this.state.textContent = `▲ ${wordsOf(error)}`;
    } finally {
      this.isAsking = false;
    }
  }

  /** @returns {Promise<{entries: Entry[], fault: string}>} newest first */
  async ask() {
    const answer = await fetch(`${this.url}?last=${MOST}`, {
      cache: "no-store",
      signal: AbortSignal.timeout(ANSWER_WITHIN_MS),
    });
    const found = await answer.json();
    if (!answer.ok) throw new Error(found.error ?? `URC answered ${answer.status}`);
    return found;
  }
}

/** @param {Entry[]} entries */
function told(entries) {
  if (entries.length === 0) return "Nothing has happened yet.";
  const older = entries.length === MOST ? ", 'urc audit' shows older ones" : "";
  const asked = new Date().toLocaleTimeString("en-GB", { hour12: false });
  return `${entries.length} entries at ${asked}${older}`;
}

/** @param {Entry} entry */
function row(entry) {
  const el = element("li", "dev-row");
  el.dataset["what"] = entry.what;
  const level = LEVELS[entry.what];
  if (level) el.dataset["level"] = level;
  const head = element("div", "dev-row-head");
  head.append(
    element("span", "", timeText(entry.at)),
    element("span", "dev-row-sign", SIGNS[entry.what] ?? visible(entry.what)),
    element("span", "", visible(whoText(entry))),
  );
  el.append(head, element("span", "dev-row-wide", visible(mainText(entry))));
  if (entry.data) el.append(element("span", "dev-row-wide dev-hex", visible(entry.data)));
  return el;
}

/** @param {Entry} entry */
function whoText({ who, role, client, epoch }) {
  const more = [role, client, epoch ? `lease ${epoch}` : ""].filter(Boolean).join(", ");
  return more ? `${who} (${more})` : who;
}

/** @param {Entry} entry */
function mainText({ command, arguments: given, outcome, times, lasted_s }) {
  const count = times > 1 ? `${times} times` : "";
  const lasted = lasted_s > 0 ? `${lasted_s} s` : "";
  const main = [command, given === "{}" ? "" : given].filter(Boolean).join(" ");
  return [main, outcome, count, lasted].filter(Boolean).join(" · ");
}

/** @param {number} at */
function timeText(at) {
  const time = new Date(at * 1000);
  const day = `${time.getFullYear()}-${two(time.getMonth() + 1)}-${two(time.getDate())}`;
  return `${day} ${time.toLocaleTimeString("en-GB", { hour12: false })}`;
}

/** @param {number} number */
function two(number) {
  return String(number).padStart(2, "0");
}
