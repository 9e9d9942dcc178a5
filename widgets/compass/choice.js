// @ts-check
/**
 * Choice of a heading by a tap on the rose or by arrow keys. A button sends the chosen heading; the
 * choice alone sends nothing.
 */
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
import { attribute, drawing, part, style, write } from "urc/kit";
import { bearing, bearingAt, figures } from "./bearing.js";

const KEYS = /** @type {Record<string, number>} */ ({
  ArrowRight: 1,
  ArrowUp: 1,
  ArrowLeft: -1,
  ArrowDown: -1,
  PageUp: 10,
  PageDown: -10,
});

export class Choice {
  /**
   * @param {Context} ctx
   * @param {(degrees: number) => number} angle returns the robot's angle for a bearing
   */
  constructor(ctx, angle) {
    this.ctx = ctx;
    this.angle = angle;
    this.rose = part(ctx.el, ".compass-body");
    this.mark = drawing(ctx.el, ".compass-choice");
    this.button = /** @type {HTMLButtonElement} */ (part(ctx.el, ".compass-set"));
    this.answer = part(ctx.el, ".compass-answer");
    /** @type {number | null} */
    this.chosen = null;
    /** Bearing at the top of the rose. */
    this.up = 0;
    this.heading = 0;
    this.isReady = false;
    this.isWaiting = false;
    const { signal } = ctx;
    this.rose.addEventListener("click", (event) => this.click(event), { signal });
    this.rose.addEventListener("keydown", (event) => this.key(event), { signal });
    this.button.addEventListener("click", () => void this.send(), { signal });
  }

  /**
   * @param {number | null} heading
   * @param {number} up
   * @param {Outlet | undefined} outlet
   */
  update(heading, up, outlet) {
    this.up = up;
    if (heading !== null) this.heading = heading;
    this.isReady = outlet?.isReady ?? false;
    this.button.title = outlet?.reason ?? "";
    this.show();
  }

  show() {
    const { t } = this.ctx;
    this.button.disabled = this.chosen === null || !this.isReady || this.isWaiting;
    attribute(this.mark, "visibility", this.chosen === null ? "hidden" : "visible");
    if (this.chosen === null) return;
    style(this.mark, "transform", `rotate(${(this.chosen - this.up).toFixed(1)}deg)`);
    const text = `${figures(this.chosen)}°`;
    attribute(this.rose, "aria-valuenow", String(Math.round(this.chosen) % 360));
    attribute(this.rose, "aria-valuetext", text);
    write(this.button, t("Set {heading}", { heading: text }));
  }

  /** @param {MouseEvent} event */
  click(event) {
    const { left, top, width, height } = this.rose.getBoundingClientRect();
    const [right, down] = [event.clientX - left - width / 2, event.clientY - top - height / 2];
    // In the middle, a finger is too wide to point in a direction.
    if (Math.hypot(right, down) < Math.min(width, height) / 12) return;
    this.choose(Math.round(bearingAt(right, down, this.up)));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.key === "Enter") void this.send();
    const step = KEYS[event.key];
    if (event.key === "Escape") this.choose(null);
    else if (step !== undefined) this.choose(Math.round((this.chosen ?? this.heading) + step));
    else return;
    event.preventDefault();
  }

  /** @param {number | null} degrees */
  choose(degrees) {
    // A small cell has no room for the button, so nothing can be sent or chosen.
    if (!this.button.checkVisibility()) return;
    this.chosen = degrees === null ? null : bearing(degrees);
    write(this.answer, "");
    if (degrees === null) {
      write(this.button, this.ctx.t("Set heading"));
      attribute(this.rose, "aria-valuetext", this.ctx.t("none chosen"));
    }
    this.show();
  }

  async send() {
    if (this.chosen === null || !this.isReady || this.isWaiting) return;
    this.isWaiting = true;
    write(this.answer, "…");
    this.show();
    try {
      await this.ctx.send("set_heading", { value: this.angle(this.chosen) });
      this.choose(null);
    } catch (error) {
      write(this.answer, `▲ ${error instanceof Error ? error.message : error}`);
    } finally {
      this.isWaiting = false;
      this.show();
    }
  }
}
