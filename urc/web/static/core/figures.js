// @ts-check
/**
 * Numbers as people read them: all digits that mean something, and none that arithmetic made up.
 * The only place where that is decided. Pure.
 */

/** So many digits are written where nobody has said how many mean something. */
const FIGURES = 4;
/** A number has so many digits that mean something, as a float of 32 bits: 73.0000019073486 is 73. */
const TRUSTED = 7;
/** More digits after the point are not written. */
const MOST = 100;

/**
 * Return a number with so many digits after the point; never as "-0".
 *
 * @param {number} value
 * @param {number} digits
 */
export function fixed(value, digits) {
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

/**
 * Return a number by four digits that mean something; what stands before the point is never rounded.
 *
 * @param {number} value
 */
export function rough(value) {
  const text = Math.abs(value) < 10 ** FIGURES ? value.toPrecision(FIGURES) : value.toFixed(0);
  return String(Number(text));
}

/**
 * Return how many digits after the point a number has in the unit that is shown, where it has
 * `digits` in its own: as many as are needed to tell apart what was not the same.
 *
 * @param {number | undefined} digits undefined stays what it is
 * @param {(value: number) => number} factor to the unit that is shown, as of the context's `unit`
 */
export function digitsIn(digits, factor) {
  if (digits === undefined) return undefined;
  const step = Math.abs(factor(1) - factor(0));
  // An offset costs the step its last places: a hundredth must still need two digits.
  const needed = Math.ceil(digits - Math.log10(step) - 1e-9);
  return Number.isFinite(needed) ? Math.min(MOST, Math.max(0, needed)) : digits;
}

/**
 * Return a number of a signal in the unit that is shown: by its precision, else as fine as it came.
 *
 * @param {number} value in the signal's unit
 * @param {number | undefined} precision digits after the point that mean something in the signal's unit
 * @param {(value: number) => number} [factor] to the unit that is shown
 */
export function figure(value, precision, factor) {
  if (!factor) return precision === undefined ? exact(value) : fixed(value, precision);
  const digits = digitsIn(precision, factor);
  const shown = factor(value);
  return digits === undefined ? asFine(value, shown, factor) : fixed(shown, digits);
}

/**
 * Return a converted number with as many digits as it came with, and no fewer than four.
 *
 * @param {number} value as it came
 * @param {number} shown
 * @param {(value: number) => number} factor
 */
function asFine(value, shown, factor) {
  const came = digitsIn(placesOf(value), factor) ?? 0;
  const four = FIGURES - 1 - magnitude(shown);
  // Near an offset that takes most of it away, only what arithmetic left behind would be seen.
  const trusted = TRUSTED - 1 - magnitude(Math.max(Math.abs(shown), Math.abs(factor(0))));
  const digits = Math.max(0, Math.min(Math.max(came, four), trusted, MOST));
  return Number.isFinite(digits) ? exact(Number(shown.toFixed(digits))) : exact(shown);
}

/** The same, but for what stands before the point: that is never rounded. @param {number} value */
function exact(value) {
  if (Number.isInteger(value)) return String(value);
  return String(Number(Math.abs(value) < 10 ** TRUSTED ? value.toPrecision(TRUSTED) : value.toFixed(0)));
}

/** How many digits a number has after its point. @param {number} value */
function placesOf(value) {
  const [digits = "", power = "0"] = exact(value).split("e");
  return Math.max(0, (digits.split(".")[1] ?? "").length - Number(power));
}

/** The power of ten of its first digit; that of 0 is none. @param {number} value */
function magnitude(value) {
  return Math.floor(Math.log10(Math.abs(value)));
}
