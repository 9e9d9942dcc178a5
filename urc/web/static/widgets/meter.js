// @ts-check
/**
 * One value on a scale, with its number below, as the common part of all scales. `import { Meter }
 * from "urc/meter"`.
 *
 * @typedef {import("../core/types.js").Context} Context
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").Signal} Signal
 *
 * @callback DrawScale
 * @param {Signal} signal
 * @param {[number, number]} scale ends of the scale, in the signal's unit
 * @param {(value: number) => number} factor conversion to the displayed unit
 */
import { attribute, digitsIn, format, noteOf, number, part, tell, write } from "./kit.js";
import { ends } from "./axis_ticks.js";

export class Meter {
  /**
   * @param {Context} ctx uses its input `value`, and its options min, max, precision
   * @param {string} name name of the widget; its template has `.NAME`, `.NAME-meter`, `-text`, `-unit`, `-note`
   * @param {DrawScale} draw called for each change of the scale
   */
  constructor(ctx, name, draw) {
    this.ctx = ctx;
    this.draw = draw;
    this.root = part(ctx.el, `.${name}`);
    this.meter = part(ctx.el, `.${name}-meter`);
    this.text = part(ctx.el, `.${name}-text`);
    this.unit = part(ctx.el, `.${name}-unit`);
    this.note = part(ctx.el, `.${name}-note`);
    /** @type {[number, number]} */
    this.scale = [0, 1];
    /** Signal of the drawn scale. @type {Signal | null} */
    this.drawn = null;
    this.shownIn = "";
    /** Width of the number in characters; its unit is half as large. */
    this.characters = 1;
  }

  /**
   * @param {Reading} value
   * @returns {number | null} the value in the signal's unit; null while it is unknown
   */
  show(value) {
    const { ctx, root, meter } = this;
    const { symbol, factor } = ctx.unit("value");
    const known = number(value);
    if (value.signal !== this.drawn || symbol !== this.shownIn) {
      [this.drawn, this.shownIn] = [value.signal, symbol];
      this.scale = ends(value.signal, ctx.options);
      this.draw(value.signal, this.scale, factor);
      attribute(meter, "aria-valuemin", format(factor(this.scale[0])));
      attribute(meter, "aria-valuemax", format(factor(this.scale[1])));
    }
    attribute(root, "data-state", value.state);
    attribute(root, "data-alarm", value.alarm);
    attribute(root, "data-known", known === null ? "no" : "yes");
    const wanted = ctx.options["precision"];
    const digits = digitsIn(typeof wanted === "number" ? wanted : value.signal.precision, factor);
    const figure = format(known === null ? null : factor(known), digits);
    this.characters = figure.length + symbol.length / 2;
    write(this.text, figure);
    write(this.unit, known === null ? "" : symbol);
    const said = noteOf(value, ctx.t);
    write(this.note, said);
    const spoken = said ? `${figure} ${symbol}, ${said.replace(/[▲◆] /g, "")}` : `${figure} ${symbol}`;
    tell(meter, {
      "aria-valuenow": format(factor(known ?? this.scale[0])),
      "aria-valuetext": known === null ? ctx.t("unknown") : spoken,
    });
    return known;
  }
}
