// @ts-check
/**
 * A tape of heights that moves past a mark.
 *
 * The tape is drawn for three times the visible range, and then only moved. It is redrawn when the mark
 * approaches an end.
 */
import { digitsOf, wholes } from "./axis_ticks.js";
import { format, style, svg } from "./kit.js";

/** Height of the drawing, in its own units. */
export const HIGH = 200;

/**
 * Return the rungs around a value.
 *
 * @param {number} value
 * @param {number} span visible range
 * @returns {{base: number, step: number, rungs: {value: number, y: number, isMain: boolean}[]}}
 *   `base` is the value at y = 0; y grows downwards
 */
export function tape(value, span) {
  const step = stepOf(span);
  const base = Math.round(value / span) * span;
  const places = wholes(Math.ceil((base - 1.5 * span) / step), Math.floor((base + 1.5 * span) / step));
  const rungs = places.map((place) => {
    const at = Number((place * step).toPrecision(12)) + 0;
    return { value: at, y: (-(at - base) / span) * HIGH, isMain: place % 2 === 0 };
  });
  return { base, step, rungs };
}

/**
 * Return whether a tape drawn around `base` still covers the visible range.
 *
 * @param {number} value
 * @param {number} base
 * @param {number} span
 */
export function covers(value, base, span) {
  return Math.abs(value - base) <= span;
}

/**
 * Return the offset of the tape that puts a value at the mark.
 *
 * @param {number} value
 * @param {number} base
 * @param {number} span
 */
export function offset(value, base, span) {
  return ((value - base) / span) * HIGH;
}

/** The tape in a drawing of 200 units of height, with y = 0 at the mark. */
export class HeightTape {
  /**
   * @param {SVGElement} group element of the drawing that the tape fills
   * @param {number} span visible range, in the displayed unit
   * @param {object} look
   * @param {string} look.rung class of the rungs
   * @param {string} look.label class of the labels
   * @param {number} look.right x of the right end of the rungs
   */
  constructor(group, span, look) {
    this.group = group;
    this.span = span;
    this.look = look;
    this.base = NaN;
  }

  /** @param {number} value in the displayed unit */
  show(value) {
    if (!covers(value, this.base, this.span)) this.draw(value);
    style(this.group, "transform", `translateY(${offset(value, this.base, this.span).toFixed(2)}px)`);
  }

  /** @param {number} value */
  draw(value) {
    const { rung, label, right } = this.look;
    const { base, step, rungs } = tape(value, this.span);
    this.base = base;
    const digits = digitsOf([step]);
    const parts = rungs.flatMap((one) => {
      const y = one.y.toFixed(2);
      const line = svg("path", { class: rung, d: `M${right - (one.isMain ? 18 : 10)} ${y}H${right}` });
      if (!one.isMain) return [line];
      const text = svg("text", { class: label, x: right - 22, y });
      text.textContent = format(one.value, digits);
      return [line, text];
    });
    this.group.replaceChildren(...parts);
  }
}

/** @param {number} span */
function stepOf(span) {
  const rough = span / 8;
  const decade = 10 ** Math.floor(Math.log10(rough));
  return decade * ([1, 2, 5, 10].find((each) => each * decade >= rough * 0.999) ?? 10);
}
