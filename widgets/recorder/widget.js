// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { attribute, many, part, save, worst, write } from "urc/kit";
import { Recording, span } from "./rows.js";

const EVERY_MS = 500;

class Recorder {
  /** @param {Context} ctx */
  constructor(ctx) {
    this.ctx = ctx;
    const { el, options, signal } = ctx;
    this.root = part(el, ".recorder");
    this.clock = part(el, ".recorder-time");
    this.note = part(el, ".recorder-note");
    this.main = part(el, ".recorder-main");
    this.keep = /** @type {HTMLButtonElement} */ (part(el, ".recorder-save"));
    this.most = Number(options["rows"] ?? 100_000);
    this.recording = new Recording(this.most, Infinity);
    this.isOn = false;
    this.begunMs = 0;
    this.timer = 0;
    /** @type {readonly Reading[]} */
    this.readings = [];
    this.main.addEventListener("click", () => (this.isOn ? this.stop() : this.begin()), { signal });
    this.keep.addEventListener("click", () => this.save(), { signal });
    signal.addEventListener("abort", () => clearInterval(this.timer));
    ctx.each("values", (reading, missed) => this.hear(reading, missed));
  }

  /** @param {readonly Reading[]} readings */
  update(readings) {
    this.readings = readings;
    attribute(this.root, "data-state", worst(readings).state);
    if (!this.isOn) this.show(); // the first readings can lack a value
  }

  /**
   * @param {Reading} reading
   * @param {number} missed
   */
  hear(reading, missed) {
    if (!this.isOn) return;
    this.recording.add(reading, missed, performance.now() / 1000, Date.now());
    if (this.recording.isFull) this.stop();
  }

  begin() {
    this.begunMs = performance.now();
    this.recording = new Recording(this.most, this.begunMs / 1000);
    this.isOn = true;
    this.timer = window.setInterval(() => this.show(), EVERY_MS);
    this.show();
  }

  stop() {
    clearInterval(this.timer);
    this.isOn = false;
    this.show();
  }

  save() {
    const begun = new Date(this.recording.rows[0]?.[0] ?? Date.now()).toISOString().slice(0, 19);
    save(this.recording.table(), `recording-${begun.replaceAll(":", "")}.csv`, "text/csv");
  }

  show() {
    const { t } = this.ctx;
    const count = this.recording.rows.length;
    const { isFull } = this.recording;
    attribute(this.root, "data-phase", this.isOn ? "on" : isFull ? "full" : count > 0 ? "kept" : "idle");
    write(this.main, this.isOn ? t("Stop recording") : t("Record"));
    if (this.isOn) write(this.clock, span((performance.now() - this.begunMs) / 1000));
    this.keep.disabled = count === 0;
    const { lost } = this.recording;
    const loss = lost > 0 ? t("▲ {count} lost", { count: lost }) : "";
    write(this.note, [this.words(count, isFull), loss].filter(Boolean).join(" · "));
  }

  /**
   * @param {number} count
   * @param {boolean} isFull
   */
  words(count, isFull) {
    const { t } = this.ctx;
    if (isFull) return t("◆ full: {count} rows", { count });
    if (this.isOn) return t("● recording: {count} rows", { count });
    if (count > 0) return t("{count} rows, not saved automatically", { count });
    return worst(this.readings).state === "none" ? `— ${t("no value yet")}` : t("nothing recorded");
  }
}

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const recorder = new Recorder(ctx);
    return { update: ({ values }) => recorder.update(many(values)) };
  },
};
