// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Signal} Signal */
import { attribute, fit, format, number, part, style } from "urc/kit";
import { Meter } from "urc/meter";
import { bands, digitsOf, share, ticks } from "urc/axis_ticks";

const TICKS = 4;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options } = ctx;
    const fill = part(el, ".bar-fill");
    const target = part(el, ".bar-target");
    const readout = part(el, ".bar-number");
    const extremes = options["extremes"] === true ? new Extremes(part(el, ".bar-extremes")) : null;
    let origin = 0;
    const meter = new Meter(ctx, "bar", (signal, scale, factor) => {
      const start = options["origin"];
      origin = share(typeof start === "number" ? start : scale[0], ...scale);
      style(meter.root, "--bar-origin", String(origin));
      drawScale(el, signal, scale, factor);
    });

    return {
      update({ value, target: wanted }) {
        if (!value) return;
        const known = meter.show(value);
        const place = known === null ? origin : share(known, ...meter.scale);
        // Set on the part that uses the property: all parts would inherit a property of the root.
        style(fill, "--bar-from", Math.min(origin, place).toFixed(4));
        style(fill, "--bar-long", Math.abs(place - origin).toFixed(4));
        if (known !== null) extremes?.add(place);
        const aim = number(wanted);
        attribute(target, "hidden", aim === null ? "" : null);
        if (aim !== null) style(target, "--bar-target", share(aim, ...meter.scale).toFixed(4));
        fit(readout, "--bar-characters", meter.characters);
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
    const made = box("bar-band", share(from, ...scale));
    made.style.setProperty("--bar-size", String(share(to, ...scale) - share(from, ...scale)));
    made.dataset["alarm"] = alarm;
    return made;
  });
  part(el, ".bar-bands").replaceChildren(...parts);
  const [least, most] = [factor(scale[0]), factor(scale[1])];
  const values = ticks(least, most, TICKS);
  const digits = digitsOf(values);
  const figures = values.map((value) => {
    const made = box("bar-figure", share(value, least, most));
    made.textContent = format(value, digits);
    return made;
  });
  part(el, ".bar-figures").replaceChildren(...figures);
}

/**
 * @param {string} name
 * @param {number} place 0 to 1
 */
function box(name, place) {
  const made = document.createElement("div");
  made.className = name;
  made.style.setProperty("--bar-place", String(place));
  return made;
}

/** Marks of the lowest and highest value so far. */
class Extremes {
  /** @param {HTMLElement} root */
  constructor(root) {
    this.root = root;
    this.least = Infinity;
    this.most = -Infinity;
    this.marks = [box("bar-extreme", 0), box("bar-extreme", 0)];
  }

  /** @param {number} place 0 to 1 */
  add(place) {
    if (this.most < this.least) this.root.append(...this.marks);
    this.least = Math.min(this.least, place);
    this.most = Math.max(this.most, place);
    for (const [index, mark] of this.marks.entries()) {
      style(mark, "--bar-place", String(index ? this.most : this.least));
    }
  }
}
