// @ts-check
/**
 * A tape that moves past a mark. Pure.
 *
 * The tape is drawn for three times the visible range, and then only moved. It is redrawn when the mark
 * approaches an end.
 */
import { wholes } from "urc/axis_ticks";

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

/** @param {number} span */
function stepOf(span) {
  const rough = span / 8;
  const decade = 10 ** Math.floor(Math.log10(rough));
  return decade * ([1, 2, 5, 10].find((each) => each * decade >= rough * 0.999) ?? 10);
}
