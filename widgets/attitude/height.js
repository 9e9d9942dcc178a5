// @ts-check
/**
 * The tape next to a horizon, with the height at its middle.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Context} Context
 * @typedef {import("../../urc/web/static/core/types.js").Reading} Reading
 */
import { HeightTape } from "urc/height_tape";
import { DASH, attribute, drawing, figure, number, part, write } from "urc/kit";

/** x of the right end of the rungs in the drawing. */
const RIGHT = 70;

export class Height {
  /** @param {Context} ctx */
  constructor(ctx) {
    const { el, options } = ctx;
    this.ctx = ctx;
    this.root = part(el, ".attitude-tape");
    this.text = part(el, ".attitude-height-text");
    this.unit = part(el, ".attitude-height-unit");
    const look = { rung: "attitude-height-rung", label: "attitude-height-label", right: RIGHT };
    this.tape = new HeightTape(drawing(el, ".attitude-heights"), Number(options["height_span"] ?? 20), look);
  }

  /** @param {Reading | undefined} reading */
  show(reading) {
    const { symbol, factor } = this.ctx.unit("height");
    const value = number(reading);
    attribute(this.root, "data-state", reading?.state ?? "none");
    attribute(this.root, "data-alarm", reading?.alarm ?? "");
    attribute(this.root, "data-known", value === null ? "no" : "yes");
    if (value !== null) this.tape.show(factor(value));
    write(this.text, value === null ? DASH : figure(value, reading?.signal.precision, factor));
    write(this.unit, value === null ? "" : symbol);
  }
}
