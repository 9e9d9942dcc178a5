// @ts-check
/**
 * Formatting of numbers with all significant digits, and without artefacts of floating-point
 * arithmetic. All pages use it. Pure.
 */

/** Significant digits without a declared precision. */
const FIGURES = 4;
/** Reliable digits of a number, as in a 32-bit float, where 73.0000019073486 is 73. */
const TRUSTED = 7;
/** Maximum number of digits after the point. */
const MOST = 100;

/**
 * Return a number with `digits` digits after the point; never as "-0".
 *
 * @param {number} value
 * @param {number} digits
 */
export function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

/**
 * Return a number with four significant digits; the integer part is never rounded.
 *
 * @param {number} value
 */
export function rough(value) {
  const text = Math.abs(value) < 10 ** FIGURES ? value.toPrecision(FIGURES) : value.toFixed(0);
  return String(Number(text));
}

/**
 * Return the digits after the point in the displayed unit, for `digits` in the signal's unit, so
 * that different values look different.
 *
 * @param {number | undefined} digits undefined is returned unchanged
 * @param {(value: number) => number} factor conversion to the displayed unit, as `unit` of the context
 */
export function digitsIn(digits, factor) {
  if (digits === undefined) return undefined;
  const step = Math.abs(factor(1) - factor(0));
  // An offset removes the last digits of the step, but a hundredth must still need two digits.
  const needed = Math.ceil(digits - Math.log10(step) - 1e-9);
  return Number.isFinite(needed) ? Math.min(MOST, Math.max(0, needed)) : digits;
}

/**
 * Return a signal's number in the displayed unit, with the declared precision, or else with its own
 * digits.
 *
 * @param {number} value in the signal's unit
 * @param {number | undefined} precision significant digits after the point, in the signal's unit
 * @param {(value: number) => number} [factor] conversion to the displayed unit
 */
export function figure(value, precision, factor) {
  if (!factor) return precision === undefined ? exact(value) : fixed(value, precision);
  const digits = digitsIn(precision, factor);
  const shown = factor(value);
  return digits === undefined ? asFine(value, shown, factor) : fixed(shown, digits);
}

/**
 * Return a converted number with as many digits as the original, and at least four.
 *
 * @param {number} value the original
 * @param {number} shown
 * @param {(value: number) => number} factor
 */
function asFine(value, shown, factor) {
  const came = digitsIn(placesOf(value), factor) ?? 0;
  const four = FIGURES - 1 - magnitude(shown);
  // Near a large offset, the last digits are arithmetic artefacts.
  const trusted = TRUSTED - 1 - magnitude(Math.max(Math.abs(shown), Math.abs(factor(0))));
  const digits = Math.max(0, Math.min(Math.max(came, four), trusted, MOST));
  return Number.isFinite(digits) ? exact(Number(shown.toFixed(digits))) : exact(shown);
}

/**
 * Return a number with four significant digits, without rounding the integer part.
 *
 * @param {number} value
 */
function exact(value) {
  if (Number.isInteger(value)) return String(value);
  return String(Number(Math.abs(value) < 10 ** TRUSTED ? value.toPrecision(TRUSTED) : value.toFixed(0)));
}

/** Return the digits after the point. @param {number} value */
function placesOf(value) {
  const [digits = "", power = "0"] = exact(value).split("e");
  return Math.max(0, (digits.split(".")[1] ?? "").length - Number(power));
}

/** Return the power of ten of the first digit; 0 for 0. @param {number} value */
function magnitude(value) {
  return Math.floor(Math.log10(Math.abs(value)));
}
