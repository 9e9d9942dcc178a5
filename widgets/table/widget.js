// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./rows.js").Row} Row */
/** @typedef {import("./rows.js").Level} Level */
/** @typedef {Readonly<Record<string, Reading>>} Readings */
import { attribute, many, noteOf, part, worst, write } from "urc/kit";
import { rowsOf, rowsOfLists, shown } from "./rows.js";
import { keepWholeRows } from "./whole_rows.js";

/** Minimum interval between redraws; readers of a table need no faster updates. */
const EVERY_MS = 200;

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
    const [room, scroll, more] = [part(el, ".table-room"), part(el, ".table-scroll"), part(el, ".table-more")];
    keepWholeRows({ room, scroll, table, more }, (count) => `▾ ${t("+{count} more", { count })}`, ctx.signal);
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
    ctx.signal.addEventListener("abort", () => clearTimeout(this.timer));
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
    this.rows = [
      ...rowsOf(report?.value),
      ...rowsOfLists(list(levels), list(names), list(messages)),
      ...each.map((reading) => rowOfReading(reading, t)),
    ];
    const bound = worst([report, levels, ...each]);
    attribute(this.root, "data-state", bound.state);
    write(this.note, each.length > 1 ? "" : noteOf({ ...bound, alarm: "" }, t));
    this.draw();
  }

  draw() {
    const { sort, least } = this.ctx.options;
    const rows = shown(this.rows, { sort, least, filter: this.filter?.value ?? "" });
    const worse = this.rows.filter(({ level }) => level === "error" || level === "warn").length;
    const { t } = this.ctx;
    // Old and missing values do not count as OK, even without a known problem.
    const isOld = this.root.dataset["state"] !== "live" || this.rows.some(({ level }) => level === "stale");
    const isOk = this.rows.every(({ level }) => level === "ok");
    const words = worse > 0 ? t("{count} not OK", { count: worse }) : isOld ? t("not known") : isOk ? t("all OK") : "";
    write(this.count, this.rows.length === 0 ? "" : words);
    attribute(this.root, "data-alarm", rows.some(({ level }) => level === "error") ? "hihi" : worse > 0 ? "high" : "");
    while (this.body.children.length > Math.max(1, rows.length)) this.body.lastElementChild?.remove();
    rows.forEach((row, place) => {
      const line = this.body.children[place] ?? this.body.appendChild(emptyLine());
      attribute(line, "data-level", row.level);
      const [level, name, message] = line.children;
      if (level) writeLevel(level, this.words[row.level]);
      if (name) write(name, row.name);
      if (message) write(message, row.message);
    });
    const first = this.body.children[0];
    if (rows.length > 0 || !first) return;
    attribute(first, "data-level", "unknown");
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
