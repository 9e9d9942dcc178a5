// @ts-check
/**
 * The traffic log: the traffic of every transport, with faults and notes.
 *
 * @typedef {object} Row
 * @property {number} n
 * @property {number} time_s age in milliseconds
 * @property {"sent" | "received" | "note"} kind
 * @property {string} line
 * @property {number} [size]
 * @property {string} [data] base64
 * @property {string} [verb]
 * @property {string} [address]
 * @property {string} [more]
 * @property {string} [text]
 * @property {string} [level]
 * @property {string} [picture] media type, if `data` is a whole image
 */
import { part } from "../live/badge.js";
import { bytesOf, element, hexOf, sizeText, textOf, visible } from "./bytes.js";

const ROWS_KEPT = 1000;
/** Distance from the end within which the log follows new rows. */
const NEAR_PX = 40;
/** @type {Record<Row["kind"], string>} */
const SIGNS = { sent: "→ sent", received: "← received", note: "· note" };
/** @type {Record<string, string>} */
const LEVELS = { warning: "◆ ", error: "▲ " };

export class WireLog {
  /** @param {ParentNode} root */
  constructor(root) {
    this.list = part(root, "[data-log]");
    this.state = part(root, "[data-log-state]");
    this.pauseButton = part(root, "[data-pause]");
    this.line = select(root, "[data-filter-line]");
    this.kind = select(root, "[data-filter-kind]");
    /** Text encoding by transport. @type {Map<string, string>} */
    this.encodings = new Map();
    /** @type {Row[]} */
    this.waiting = [];
    /** Rows dropped during a pause. */
    this.lost = 0;
    this.isPaused = false;
    /** Expected number of the next row. */
    this.next = 0;
    /** Offset from the server's clock to this device's. */
    this.skewMs = Infinity;
    this.pauseButton.addEventListener("click", () => this.pause(!this.isPaused));
    part(root, "[data-clear]").addEventListener("click", () => this.clear());
    part(root, "[data-copy]").addEventListener("click", () => this.copy());
    for (const filter of [this.line, this.kind]) {
      filter.addEventListener("change", () => this.filter());
    }
  }

  /** @param {{name: string, encoding: string}[]} lines */
  setLines(lines) {
    this.encodings = new Map(lines.map((line) => [line.name, line.encoding]));
    const chosen = this.line.value;
    const options = lines.map((line) => new Option(line.name, line.name));
    this.line.replaceChildren(new Option("all", ""), ...options);
    this.line.value = this.encodings.has(chosen) ? chosen : "";
    this.filter();
  }

  /** Clear the log, because the server numbers rows from the beginning on each connection. */
  restart() {
    this.next = 0;
    this.skewMs = Infinity;
  }

  /** @param {{rows: Row[], first: number, now: number}} message oldest first */
  add({ rows, first, now }) {
    if (first > this.next) {
      const text = `${first - this.next} rows are missing here: they came too fast for this page`;
      rows = [{ n: first, time_s: 0, kind: "note", line: "URC", level: "warning", text }, ...rows];
    }
    this.next = first + rows.length - (first > this.next ? 1 : 0);
    // The fastest message so far provides the best estimate of the offset, and keeps times in
    // order.
    this.skewMs = Math.min(this.skewMs, Date.now() - now);
    const nowMs = this.skewMs + now;
    const timed = rows.map((row) => ({ ...row, time_s: nowMs - row.time_s }));
    if (this.isPaused) {
      this.waiting.push(...timed);
      const excess = Math.max(0, this.waiting.length - ROWS_KEPT);
      this.waiting.splice(0, excess);
      this.lost += excess;
    } else {
      this.show(timed);
    }
    this.tell();
  }

  /** @param {Row[]} rows rows with times on the page's own clock */
  show(rows) {
    const list = this.list;
    const isAtEnd = list.scrollHeight - list.scrollTop - list.clientHeight < NEAR_PX;
    const before = list.scrollHeight;
    const newest = rows.slice(-ROWS_KEPT);
    list.append(...newest.map((row) => this.element(row)));
    while (list.childElementCount > ROWS_KEPT) list.firstElementChild?.remove();
    if (isAtEnd) list.scrollTop = list.scrollHeight;
    else if (list.scrollHeight < before) list.scrollTop -= before - list.scrollHeight;
  }

  /** @param {boolean} isPaused */
  pause(isPaused) {
    this.isPaused = isPaused;
    this.pauseButton.setAttribute("aria-pressed", String(isPaused));
    if (!isPaused) {
      if (this.lost > 0) {
        const text = `${this.lost} rows are missing here: they came while the log was paused`;
        const time_s = Date.now();
        this.waiting.unshift({ n: 0, time_s, kind: "note", line: "URC", level: "warning", text });
      }
      this.show(this.waiting);
      this.waiting = [];
      this.lost = 0;
    }
    this.tell();
  }

  clear() {
    this.list.replaceChildren();
    this.waiting = [];
    this.lost = 0;
    this.tell();
  }

  async copy() {
    const rows = [...this.list.children].filter((el) => el instanceof HTMLElement && !el.hidden);
    const lines = rows.map((el) => [...el.querySelectorAll("[data-copied]")].map((one) => one.textContent).join("\t"));
    try {
      await navigator.clipboard.writeText(`${lines.join("\n")}\n`);
      this.state.textContent = `${lines.length} rows are in the clipboard`;
    } catch {
      this.state.textContent = "The browser does not let this page copy: mark the rows and copy them";
    }
  }

  filter() {
    for (const el of this.list.children) {
      if (el instanceof HTMLElement) el.hidden = !this.isWanted(el);
    }
    this.tell();
  }

  /** @param {HTMLElement} el */
  isWanted(el) {
    const { line, kind } = el.dataset;
    const isOfLine = !this.line.value || line === this.line.value || line === "URC";
    return isOfLine && (!this.kind.value || kind === this.kind.value);
  }

  tell() {
    const count = this.list.childElementCount;
    const full = count === ROWS_KEPT ? ", older ones are gone" : "";
    const shown = `${count} row${count === 1 ? "" : "s"}${full}`;
    const text = this.isPaused ? `Paused: ${this.waiting.length} wait. ${shown}` : shown;
    if (this.state.textContent !== text) this.state.textContent = text;
  }

  /** @param {Row} row */
  element(row) {
    const el = element("li", "dev-row");
    el.dataset["kind"] = row.kind;
    el.dataset["line"] = row.line;
    if (row.level) el.dataset["level"] = row.level;
    const head = element("div", "dev-row-head");
    head.append(
      copied(element("span", "", timeText(row.time_s))),
      copied(element("span", "", row.line)),
      copied(element("span", "dev-row-sign", SIGNS[row.kind])),
    );
    el.append(head, ...this.body(row));
    el.hidden = !this.isWanted(el);
    return el;
  }

  /**
   * @param {Row} row
   * @returns {HTMLElement[]}
   */
  body(row) {
    if (row.kind === "note") {
      const text = `${LEVELS[row.level ?? ""] ?? ""}${visible(row.text ?? "")}`;
      return [copied(element("span", "dev-row-wide", text))];
    }
    const size = row.size ?? 0;
    const bytes = bytesOf(row.data ?? "");
    const encoding = this.encodings.get(row.line) ?? "utf-8";
    const cut = bytes.length < size && !row.text ? ` … (${sizeText(size)})` : "";
    const isPicture = (row.picture ?? "") !== "" || (row.text ?? "").startsWith("<");
    const text = row.text || textOf(bytes, encoding) + cut;
    if (row.verb) {
      const address = [row.verb, row.address, row.more].filter(Boolean).join(" ");
      const wide = [copied(element("span", "dev-row-wide dev-hex", visible(address)))];
      if (row.picture) wide.push(picture(bytes, row.picture));
      if (size > 0) wide.push(copied(element("span", "dev-row-wide dev-text", visible(text))));
      return wide;
    }
    if (isPicture) {
      const shown = copied(element("span", "dev-row-wide dev-text", visible(text)));
      return row.picture ? [picture(bytes, row.picture), shown] : [shown];
    }
    const hex = copied(element("span", "dev-hex", hexOf(bytes) + cut));
    return [hex, copied(element("span", "dev-text", text))];
  }
}

/**
 * @param {Uint8Array<ArrayBuffer>} bytes
 * @param {string} type
 */
function picture(bytes, type) {
  const frame = element("span", "dev-row-wide");
  const img = new Image();
  const url = URL.createObjectURL(new Blob([bytes], { type }));
  const free = () => URL.revokeObjectURL(url);
  img.addEventListener("load", free);
  img.addEventListener("error", free);
  img.alt = "";
  img.className = "dev-picture";
  img.src = url;
  frame.append(img);
  return frame;
}

/** @param {number} ms */
function timeText(ms) {
  const time = new Date(ms);
  const clock = time.toLocaleTimeString("en-GB", { hour12: false });
  return `${clock}.${String(time.getMilliseconds()).padStart(3, "0")}`;
}

/** @param {HTMLElement} el */
function copied(el) {
  el.dataset["copied"] = "";
  return el;
}

/**
 * @param {ParentNode} root
 * @param {string} selector
 */
function select(root, selector) {
  const found = part(root, selector);
  if (!(found instanceof HTMLSelectElement)) throw new Error(`${selector} is no select`);
  return found;
}
