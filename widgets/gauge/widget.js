// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Signal} Signal */
import { attribute, drawing, format, number, style, svg } from "urc/kit";
import { Meter } from "urc/meter";
import { bands, digitsOf, share, ticks } from "urc/axis_ticks";
import { angle, arc, dashes, needle, place } from "./arc.js";

const TICKS = 6;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options } = ctx;
    const pointer = drawing(el, ".gauge-needle polygon");
    const target = drawing(el, ".gauge-target");
    const extremes = options["extremes"] === true ? new Extremes(drawing(el, ".gauge-extremes")) : null;
    const meter = new Meter(ctx, "gauge", (signal, scale, factor) => drawScale(el, signal, scale, factor));

    return {
      update({ value, target: wanted }) {
        if (!value) return;
        const known = meter.show(value);
        if (known !== null) {
          attribute(pointer, "points", needle(angle(share(known, ...meter.scale))));
          extremes?.add(share(known, ...meter.scale));
        }
        const aim = number(wanted);
        attribute(target, "visibility", aim === null ? "hidden" : "visible");
        if (aim !== null) style(target, "transform", `rotate(${angle(share(aim, ...meter.scale)).toFixed(2)}deg)`);
      },
    };
  },
};

/**
 * @param {HTMLElement} el
 * @param {Signal} signal
 * @param {[number, number]} scale
 * @param {(value: number) => number} factor conversion to the displayed unit
 */
function drawScale(el, signal, scale, factor) {
  const parts = bands(signal.limits, ...scale).map(({ from, to, alarm }) => {
    const d = arc(share(from, ...scale), share(to, ...scale), 80);
    return svg("path", { class: "gauge-band", "data-alarm": alarm, d });
  });
  drawing(el, ".gauge-bands").replaceChildren(...parts);
  const shown = [factor(scale[0]), factor(scale[1])];
  const [least = 0, most = 1] = shown;
  const values = ticks(least, most, TICKS);
  const places = values.map((value) => share(value, least, most));
  attribute(drawing(el, ".gauge-ticks"), "d", dashes(places, 72, 88));
  const digits = digitsOf(values);
  const figures = values.map((value) => {
    const [x = "0", y = "0"] = place(angle(share(value, least, most)), 61).split(" ");
    const made = svg("text", { class: "gauge-figure", x, y });
    made.textContent = format(value, digits);
    return made;
  });
  drawing(el, ".gauge-figures").replaceChildren(...figures);
}

/** Marks of the lowest and highest value so far. */
class Extremes {
  /** @param {SVGElement} root */
  constructor(root) {
    this.least = Infinity;
    this.most = -Infinity;
    this.marks = [svg("path", { d: "M0 -90v-9" }), svg("path", { d: "M0 -90v-9" })];
    this.root = root;
  }

  /** @param {number} share 0 to 1 */
  add(share) {
    if (this.most < this.least) this.root.append(...this.marks);
    this.least = Math.min(this.least, share);
    this.most = Math.max(this.most, share);
    for (const [place, mark] of this.marks.entries()) {
      style(mark, "transform", `rotate(${angle(place ? this.most : this.least).toFixed(2)}deg)`);
    }
  }
}
