// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/types.js").Signal} Signal */
import { attribute, drawing, format, noteOf, number, part, style, svg, tell, write } from "urc/kit";
import { bands, digitsOf, ends, share, ticks } from "urc/scale";
import { angle, arc, dashes, place } from "./arc.js";

const TICKS = 6;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t } = ctx;
    const root = part(el, ".gauge");
    const meter = part(el, ".gauge-meter");
    const needle = part(el, ".gauge-needle");
    const target = drawing(el, ".gauge-target");
    const text = part(el, ".gauge-text");
    const unit = part(el, ".gauge-unit");
    const note = part(el, ".gauge-note");
    const extremes = options["extremes"] === true ? new Extremes(drawing(el, ".gauge-extremes")) : null;
    /** What the scale was drawn for. @type {Signal | null} */
    let drawn = null;
    let shownIn = "";
    /** @type {[number, number]} */
    let scale = [0, 1];

    return {
      update({ value, target: wanted }) {
        if (!value) return;
        const { symbol, factor } = ctx.unit("value");
        const known = number(value);
        if (value.signal !== drawn || symbol !== shownIn) {
          [drawn, shownIn] = [value.signal, symbol];
          scale = ends(value.signal, options);
          drawScale(el, value.signal, scale, factor);
          attribute(meter, "aria-valuemin", format(factor(scale[0])));
          attribute(meter, "aria-valuemax", format(factor(scale[1])));
        }
        attribute(root, "data-state", value.state);
        attribute(root, "data-alarm", value.alarm);
        attribute(root, "data-known", known === null ? "no" : "yes");
        if (known !== null) {
          style(needle, "transform", `rotate(${angle(share(known, ...scale)).toFixed(2)}deg)`);
          extremes?.add(share(known, ...scale));
        }
        const aim = number(wanted);
        attribute(target, "visibility", aim === null ? "hidden" : "visible");
        if (aim !== null) style(target, "transform", `rotate(${angle(share(aim, ...scale)).toFixed(2)}deg)`);
        const digits = options["precision"] ?? value.signal.precision;
        const figure = format(known === null ? null : factor(known), typeof digits === "number" ? digits : undefined);
        write(text, figure);
        write(unit, known === null ? "" : symbol);
        const said = noteOf(value, t);
        write(note, said);
        tell(meter, {
          "aria-valuenow": format(factor(known ?? scale[0])),
          "aria-valuetext": known === null ? t("unknown") : spoken(`${figure} ${symbol}`, said),
        });
      },
    };
  },
};

/**
 * @param {string} value
 * @param {string} said
 */
function spoken(value, said) {
  return said ? `${value}, ${said.replace(/[▲◆] /g, "")}` : value;
}

/**
 * @param {HTMLElement} el
 * @param {Signal} signal
 * @param {[number, number]} scale
 * @param {(value: number) => number} factor to the unit that is shown
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

/** Marks of the lowest and the highest so far. */
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
