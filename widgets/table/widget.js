// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./rows.js").Row} Row */
/** @typedef {import("./rows.js").Level} Level */
/** @typedef {import("./tree.js").Line} Line */
/** @typedef {Readonly<Record<string, Reading>>} Readings */
import { ageText, attribute, many, noteOf, part, style, worst, write } from "urc/kit";
import { Report } from "./report.js";
import { rowsOfLists, shown } from "./rows.js";
import { linesOf } from "./tree.js";
import { keepWholeRows } from "./whole_rows.js";

/** Minimum interval between redraws; readers of a table need no faster updates. */
const EVERY_MS = 200;
/** Interval at which the ages of diagnosed parts are checked. */
const AGES_MS = 1000;

/** @param {number} count @param {Context} ctx */
function moreRows(count, { t }) {
  return count === 1 ? t("1 more row") : t("{count} more rows", { count });
}

class Table {
  /** @param {Context} ctx */
  constructor(ctx) {
    this.ctx = ctx;
    const { el, t } = ctx;
    this.root = part(el, ".table");
    this.body = part(el, ".table-body");
    this.note = part(el, ".table-note");
    this.count = part(el, ".table-count");
    const table = el.querySelector("table");
    if (!table) throw new Error("the template has no table");
    this.table = table;
    const [room, scroll, more] = [part(el, ".table-room"), part(el, ".table-scroll"), part(el, ".table-more")];
    keepWholeRows({ room, scroll, table, more }, (count) => `▾ ${moreRows(count, ctx)}`, ctx.signal);
    const filter = el.querySelector(".table-filter");
    this.filter = filter instanceof HTMLInputElement ? filter : null;
    this.filter?.addEventListener("input", () => this.draw(), { signal: ctx.signal });
    /** @type {Record<Level, string>} */
    this.words = {
      error: t("▲ Error"),
      warn: t("◆ Warning"),
      stale: t("◌ Old"),
      unknown: t("◌ Unknown"),
      ok: t("● OK"),
    };
    /** @type {Row[]} */
    this.rows = [];
    this.timer = 0;
    /** @type {Readings} */
    this.readings = {};
    this.report = new Report();
    /** Serial number of the last report. */
    this.serial = -1;
    /** Branches that the operator has opened or closed, by path. @type {Map<string, boolean>} */
    this.open = new Map();
    this.isTree = ctx.options["view"] === "tree";
    ctx.each("report", ({ value, time }) => this.report.take(value, time));
    const ages = window.setInterval(() => {
      if (this.report.parts.size > 0) this.take();
    }, AGES_MS);
    this.body.addEventListener("click", (event) => this.press(event), { signal: ctx.signal });
    ctx.signal.addEventListener("abort", () => {
      clearTimeout(this.timer);
      clearInterval(ages);
    });
  }

  /** @param {Readings} readings */
  update(readings) {
    this.readings = readings;
    if (this.timer) return;
    this.take();
    this.timer = window.setTimeout(() => {
      this.timer = 0;
      if (this.readings !== readings) this.take();
    }, EVERY_MS);
  }

  take() {
    const { values, report, levels, names, messages } = this.readings;
    const { t } = this.ctx;
    const each = many(values);
    const list = (/** @type {Reading | undefined} */ reading) => (Array.isArray(reading?.value) ? reading.value : []);
    if (report && report.serial !== this.serial) this.report.take(report.value, report.time);
    if (report?.value === null) this.report.take(null, 0);
    this.serial = report?.serial ?? -1;
    this.rows = [
      ...this.report.rows(performance.now() / 1000, report?.signal.stale_after_s ?? 0),
      ...rowsOfLists(list(levels), list(names), list(messages)),
      ...each.map((reading) => rowOfReading(reading, t)),
    ];
    const bound = worst([report, levels, ...each]);
    attribute(this.root, "data-state", bound.state);
    write(this.note, each.length > 1 ? "" : noteOf({ ...bound, alarm: "" }, t));
    this.draw();
  }

  /** Open or close a branch. @param {Event} event */
  press(event) {
    const button = event.target instanceof Element ? event.target.closest(".table-fold") : null;
    const path = button?.closest("tr")?.getAttribute("data-path");
    if (!button || path === null || path === undefined) return;
    this.open.set(path, button.getAttribute("aria-expanded") !== "true");
    this.draw();
  }

  /** @returns {Line[]} */
  lines() {
    const { sort, least } = this.ctx.options;
    const filter = this.filter?.value ?? "";
    if (this.isTree) return linesOf(shown(this.rows, { sort: "given", least, filter: "" }), this.open, { sort, filter });
    const plain = { path: "", depth: 0, isParent: false, isOpen: false };
    return shown(this.rows, { sort, least, filter }).map((row) => ({ ...row, ...plain }));
  }

  draw() {
    const rows = this.lines();
    const worse = this.rows.filter(({ level }) => level === "error" || level === "warn").length;
    const { t } = this.ctx;
    // Old and missing values do not count as OK, even without a known problem.
    const isOld = this.root.dataset["state"] !== "live" || this.rows.some(({ level }) => level === "stale");
    const isOk = this.rows.every(({ level }) => level === "ok");
    const words = worse > 0 ? t("{count} not OK", { count: worse }) : isOld ? t("not known") : isOk ? t("all OK") : "";
    write(this.count, this.rows.length === 0 ? "" : words);
    attribute(this.root, "data-alarm", rows.some(({ level }) => level === "error") ? "hihi" : worse > 0 ? "high" : "");
    style(this.table, "--table-count", String(Math.max(1, rows.length)));
    while (this.body.children.length > Math.max(1, rows.length)) this.body.lastElementChild?.remove();
    rows.forEach((row, place) => {
      const line = this.body.children[place] ?? this.body.appendChild(emptyLine());
      attribute(line, "data-level", row.level);
      attribute(line, "data-path", this.isTree ? row.path : null);
      const [level, name, message] = line.children;
      if (level) writeLevel(level, row.level ? this.words[row.level] : "");
      if (name && this.isTree) writeName(name, row);
      else if (name) write(name, row.name);
      const old = row.age ? t("{age} old", { age: ageText(row.age) }) : "";
      if (message) write(message, [row.message, old].filter(Boolean).join(" · "));
    });
    const first = this.body.children[0];
    if (rows.length > 0 || !first) return;
    attribute(first, "data-level", "unknown");
    attribute(first, "data-path", null);
    const texts = [this.rows.length === 0 ? "—" : "", this.rows.length === 0 ? "" : t("no row matches the filter"), ""];
    [...first.children].forEach((cell, place) => (place ? write : writeLevel)(cell, texts[place] ?? ""));
  }
}

/**
 * Write a symbol and a word; a narrow cell shows only the symbol.
 *
 * @param {Element} cell
 * @param {string} text
 */
function writeLevel(cell, text) {
  const [sign = "", ...words] = text.split(" ");
  if (cell.children.length !== 2) {
    cell.replaceChildren(document.createElement("span"), document.createElement("span"));
    cell.children[1]?.classList.add("table-word");
  }
  const [first, second] = cell.children;
  if (first) write(first, sign);
  if (second) write(second, words.length > 0 ? ` ${words.join(" ")}` : "");
}

/**
 * Write the name of a part, as a button if there are lines below it.
 *
 * @param {Element} cell
 * @param {Line} line
 */
function writeName(cell, { name, depth, isParent, isOpen }) {
  const kind = isParent ? "button" : "span";
  let inner = cell.firstElementChild;
  if (inner?.localName !== kind) {
    inner = document.createElement(kind);
    inner.className = isParent ? "table-fold" : "table-leaf";
    if (inner instanceof HTMLButtonElement) inner.type = "button";
    cell.replaceChildren(inner);
  }
  if (inner instanceof HTMLElement) style(inner, "--depth", String(depth));
  if (isParent) attribute(inner, "aria-expanded", String(isOpen));
  write(inner, isParent ? `${isOpen ? "▾" : "▸"} ${name}` : name);
}

function emptyLine() {
  const line = document.createElement("tr");
  line.append(...Array.from({ length: 3 }, () => document.createElement("td")));
  return line;
}

/**
 * @param {Reading} reading
 * @param {Context["t"]} t
 * @returns {Row}
 */
function rowOfReading(reading, t) {
  const { signal, state, alarm } = reading;
  const value = reading.value === null ? reading.text : `${reading.text} ${reading.unit}`.trim();
  const note = noteOf(reading, t);
  /** @type {Level} */
  let level = alarm === "" ? "ok" : alarm === "low" || alarm === "high" ? "warn" : "error";
  if (state === "none") level = "unknown";
  else if (state !== "live" && level === "ok") level = "stale";
  return { name: signal.title || signal.name, level, message: note ? `${value} (${note})` : value };
}

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const table = new Table(ctx);
    return { update: (readings) => table.update(readings) };
  },
};
