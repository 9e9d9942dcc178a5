// @ts-check
/**
 * The topics of a ROS robot: types, rate, nodes, and what the profile uses. The server requests them
 * from the robot only while the section is open.
 *
 * @typedef {object} Row
 * @property {string} name
 * @property {string[]} [types]
 * @property {string[]} [publishers] omitted if unknown
 * @property {string[]} [subscribers] omitted if unknown
 * @property {number} [rate] omitted if it is not measured
 * @property {string[]} [used] signals and commands that use the topic
 * @property {boolean} [is_used]
 *
 * @typedef {{transport: string, total: number, version: number | null, known: boolean, rows: Row[]}} Table
 */
import { part } from "../live/badge.js";
import { element, visible } from "./bytes.js";
import { DASH } from "../live/store.js";

export class TopicTable {
  /**
   * @param {HTMLElement} root
   * @param {(message: object) => void} send
   */
  constructor(root, send) {
    this.send = send;
    this.fold = /** @type {HTMLDetailsElement} */ (part(root, "[data-topics]"));
    this.state = part(this.fold, "[data-topics-state]");
    this.body = part(this.fold, "[data-topics-rows]");
    this.fold.addEventListener("toggle", () => this.tell());
  }

  /** Tell the server whether the section is open. */
  tell() {
    this.send({ t: "topics", shown: this.fold.open });
  }

  /** @param {Table[]} tables */
  show(tables) {
    const lines = tables.map(({ transport, total, version, known, rows }) => {
      if (!known) return `${visible(transport)}: the bridge cannot list topics; start rosapi on the robot`;
      const ros = version === null ? "" : ` of ROS ${version}`;
      const shown = rows.length < total ? `, ${rows.length} shown` : "";
      return `${visible(transport)}: ${total} topics${ros}${shown}`;
    });
    this.state.textContent = lines.join("; ") || "No list of topics yet.";
    this.body.replaceChildren(...tables.flatMap(({ rows }) => rows.map(rowOf)));
  }
}

/** @param {Row} row */
function rowOf({ name, types = [], publishers, subscribers, rate, used = [], is_used: isUsed = false }) {
  const el = element("tr", "");
  const head = element("th", "", visible(name));
  head.setAttribute("scope", "row");
  const uses = isUsed ? `● ${used.join(", ")}`.trim() : DASH;
  const words = [types.join(", ") || DASH, rate === undefined ? DASH : `${rate}/s`, nodes(publishers), nodes(subscribers), uses];
  el.append(head, ...words.map((word) => element("td", "", visible(word))));
  return el;
}

/** @param {string[] | undefined} names undefined if unknown */
function nodes(names) {
  if (names === undefined) return "?";
  return names.length === 0 ? "0" : `${names.length}: ${names.join(", ")}`;
}
