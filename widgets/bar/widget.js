// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/types.js").Signal} Signal */
import { attribute, fit, format, noteOf, number, part, style, tell, write } from "urc/kit";
import { bands, digitsOf, ends, share, ticks } from "urc/scale";

const TICKS = 4;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t } = ctx;
    const root = part(el, ".bar");
    const meter = part(el, ".bar-meter");
    const fill = part(el, ".bar-fill");
    const target = part(el, ".bar-target");
    const readout = part(el, ".bar-number");
    const text = part(el, ".bar-text");
    const unit = part(el, ".bar-unit");
    const note = part(el, ".bar-note");
    const extremes = options["extremes"] === true ? new Extremes(part(el, ".bar-extremes")) : null;
    /** What the scale was drawn for. @type {Signal | null} */
    let drawn = null;
    let shownIn = "";
    /** @type {[number, number]} */
    let scale = [0, 1];
    let origin = 0;

    return {
      update({ value, target: wanted }) {
        if (!value) return;
        const { symbol, factor } = ctx.unit("value");
        const known = number(value);
        if (value.signal !== drawn || symbol !== shownIn) {
          [drawn, shownIn] = [value.signal, symbol];
          scale = ends(value.signal, options);
          const start = options["origin"];
          origin = share(typeof start === "number" ? start : scale[0], ...scale);
          style(root, "--bar-origin", String(origin));
          drawScale(el, value.signal, scale, factor);
          attribute(meter, "aria-valuemin", format(factor(scale[0])));
          attribute(meter, "aria-valuemax", format(factor(scale[1])));
        }
        const place = known === null ? origin : share(known, ...scale);
        attribute(root, "data-state", value.state);
        attribute(root, "data-alarm", value.alarm);
        attribute(root, "data-known", known === null ? "no" : "yes");
        // On the part that shows it: a property of the root would be handed down to all parts.
        style(fill, "--bar-from", Math.min(origin, place).toFixed(4));
        style(fill, "--bar-long", Math.abs(place - origin).toFixed(4));
        if (known !== null) extremes?.add(place);
        const aim = number(wanted);
        attribute(target, "hidden", aim === null ? "" : null);
        if (aim !== null) style(target, "--bar-target", share(aim, ...scale).toFixed(4));

        const digits = options["precision"] ?? value.signal.precision;
        const figure = format(known === null ? null : factor(known), typeof digits === "number" ? digits : undefined);
        fit(readout, "--bar-characters", figure.length + symbol.length / 2);
        write(text, figure);
        write(unit, known === null ? "" : symbol);
        const said = noteOf(value, t);
        write(note, said);
        const spoken = said ? `${figure} ${symbol}, ${said.replace(/[▲◆] /g, "")}` : `${figure} ${symbol}`;
        tell(meter, {
          "aria-valuenow": format(factor(known ?? scale[0])),
          "aria-valuetext": known === null ? t("unknown") : spoken,
        });
      },
    };
  },
};

/**
 * @param {HTMLElement} el
 * @param {Signal} signal
 * @param {[number, number]} scale
 * @param {(value: number) => number} factor to the unit that is shown
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

/** Marks of the lowest and the highest so far. */
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
