// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./frames.js").Frame} Frame */
import { DASH, ageText, attribute, noteOf, part, style, write } from "urc/kit";
import { filtered, framesOf, placeOf } from "./frames.js";

class Tree {
  /** @param {Context} ctx */
  constructor(ctx) {
    this.ctx = ctx;
    const { el } = ctx;
    this.root = part(el, ".transforms");
    this.body = part(el, ".transforms-body");
    this.count = part(el, ".transforms-count");
    this.note = part(el, ".transforms-note");
    const filter = el.querySelector(".transforms-filter");
    this.filter = filter instanceof HTMLInputElement ? filter : null;
    this.filter?.addEventListener("input", () => this.draw(), { signal: ctx.signal });
    this.oldAfter = Number(ctx.options["old_after"] ?? 2);
    /** @type {Frame[]} */
    this.frames = [];
    this.isLive = false;
  }

  /** @param {Reading | undefined} reading */
  update(reading) {
    const { t } = this.ctx;
    const state = reading?.state ?? "none";
    this.frames = framesOf(reading?.value);
    this.isLive = state === "live";
    attribute(this.root, "data-state", state);
    write(this.note, reading ? noteOf(reading, t) : t("no value yet"));
    this.draw();
  }

  draw() {
    const { t } = this.ctx;
    const isOld = (/** @type {Frame} */ frame) => !this.isLive || (frame.age !== null && frame.age > this.oldAfter);
    const old = this.isLive ? this.frames.filter(isOld).length : 0;
    const rivals = this.frames.filter(({ rival }) => rival !== "").length;
    const words = [
      old > 0 ? t("{count} old", { count: old }) : "",
      rivals > 0 ? t("◆ {count} with two parents", { count: rivals }) : "",
    ];
    write(this.count, words.filter(Boolean).join(" · "));
    attribute(this.root, "data-alarm", rivals > 0 ? "high" : "");
    const frames = filtered(this.frames, this.filter?.value ?? "");
    while (this.body.children.length > Math.max(1, frames.length)) this.body.lastElementChild?.remove();
    frames.forEach((frame, place) => this.row(this.body.children[place] ?? this.body.appendChild(emptyRow()), frame, isOld(frame)));
    const first = this.body.children[0];
    if (frames.length > 0 || !first) return;
    const texts = [this.frames.length === 0 ? DASH : t("no row matches the filter"), "", ""];
    attribute(first, "data-age", null);
    style(first, "--transforms-depth", "0");
    [...first.children].forEach((cell, place) => write(cell, texts[place] ?? ""));
  }

  /**
   * @param {Element} row
   * @param {Frame} frame
   * @param {boolean} isOld
   */
  row(row, frame, isOld) {
    const { t } = this.ctx;
    const isRoot = frame.parent === "";
    attribute(row, "data-age", isRoot ? "root" : frame.age === null ? "static" : isOld ? "old" : "live");
    style(row, "--transforms-depth", String(frame.depth));
    const [name, age, place] = row.children;
    const rival = frame.rival && t("◆ also below {frame}", { frame: frame.rival });
    if (name) {
      write(name, rival ? `${frame.name} ${rival}` : frame.name);
      attribute(name, "title", frame.name);
    }
    const old = frame.age === null ? "" : ageText(frame.age);
    if (age) write(age, isRoot ? "" : frame.age === null ? t("static") : isOld && this.isLive ? `◌ ${old}` : old);
    if (place) write(place, placeOf(frame));
  }
}

function emptyRow() {
  const row = document.createElement("tr");
  row.append(...Array.from({ length: 3 }, () => document.createElement("td")));
  return row;
}

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const tree = new Tree(ctx);
    return { update: (readings) => tree.update(readings["tree"]) };
  },
};
