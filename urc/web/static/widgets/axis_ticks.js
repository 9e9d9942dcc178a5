// @ts-check
/**
 * Arithmetic of scales: `import { ticks } from "urc/axis_ticks"`.
 *
 * Pure, so tests need no page.
 *
 * @typedef {import("../core/types.js").Alarm} Alarm
 * @typedef {import("../core/types.js").Signal} Signal
 *
 * @typedef {{from: number, to: number, alarm: Alarm}} Band Part of a scale beyond a limit; `from` and
 *   `to` in the scale's unit.
 */

/** Readable tick distances within a decade. */
const STEPS = [1, 2, 5, 10];

/** Relative difference below which two numbers are drawn as one. */
const NEAREST = 1e-12;

/**
 * Return the position of a value on a scale, as a share from 0 to 1; clamped.
 *
 * @param {number} value
 * @param {number} least
 * @param {number} most
 */
export function share(value, least, most) {
  if (!(most > least)) return 0;
  return Math.min(1, Math.max(0, (value - least) / (most - least)));
}

/**
 * Return round values of a scale, including round ends.
 *
 * @param {number} least
 * @param {number} most
 * @param {number} count approximate number; never more than twice as many
 * @returns {number[]} in ascending order
 */
export function ticks(least, most, count) {
  if (!(most > least) || !Number.isFinite(most - least)) return [];
  const rough = (most - least) / Math.max(1, count);
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = decade * (STEPS.find((each) => each * decade >= rough * 0.999) ?? 10);
  // Multiplied, not added up, because the sum of ten times 0.1 is not exactly 1.
  const places = wholes(Math.ceil(least / step - 1e-9), Math.floor(most / step + 1e-9));
  return places.map((place) => Number((place * step).toPrecision(12)) + 0);
}

/**
 * Return the integers from `first` to `last`, both included; [] beyond the range of exact integers.
 *
 * @param {number} first
 * @param {number} last
 * @returns {number[]} in ascending order
 */
export function wholes(first, last) {
  if (!Number.isSafeInteger(first) || !Number.isSafeInteger(last)) return [];
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, index) => first + index);
}

/**
 * Return the number of digits after the point for round values.
 *
 * @param {readonly number[]} values
 */
export function digitsOf(values) {
  const needed = values.map((value) => {
    const text = String(Number(value.toPrecision(10)));
    if (text.includes("e")) return 0;
    return (text.split(".")[1] ?? "").length;
  });
  return Math.min(6, Math.max(0, ...needed));
}

/**
 * Return the ends of a scale, from the options or else from the signal. The default is 0 to 100 for
 * percent, and 0 to 1 for other units.
 *
 * @param {Pick<Signal, "min" | "max" | "unit">} signal
 * @param {{min?: unknown, max?: unknown}} wanted
 * @returns {[number, number]}
 */
export function ends(signal, wanted) {
  const least = typeof wanted.min === "number" ? wanted.min : (signal.min ?? 0);
  const top = signal.unit === "%" ? 100 : 1;
  const most = typeof wanted.max === "number" ? wanted.max : (signal.max ?? Math.max(top, least + 1));
  return most > least ? [least, most] : [least, least + 1];
}

/**
 * Return the parts of a scale beyond a limit.
 *
 * @param {Signal["limits"]} limits
 * @param {number} least
 * @param {number} most
 * @returns {Band[]}
 */
export function bands(limits, least, most) {
  const { lolo, low, high, hihi } = limits ?? {};
  /** @type {Band[]} */
  const found = [];
  const add = (/** @type {number} */ from, /** @type {number} */ to, /** @type {Alarm} */ alarm) => {
    const [start, end] = [Math.max(least, from), Math.min(most, to)];
    if (end > start) found.push({ from: start, to: end, alarm });
  };
  if (lolo !== undefined) add(-Infinity, lolo, "lolo");
  if (low !== undefined) add(lolo ?? -Infinity, low, "low");
  if (high !== undefined) add(high, hihi ?? Infinity, "high");
  if (hihi !== undefined) add(hihi, Infinity, "hihi");
  return found;
}

/**
 * Return the range of a drawing with all values and the limits near them.
 *
 * @param {number} least smallest value
 * @param {number} most largest value
 * @param {readonly number[]} limits limits farther away than three times the height are omitted
 * @returns {[number, number]}
 */
export function spanOf(least, most, limits) {
  if (!(most >= least)) return [0, 1];
  let [bottom, top] = [least, most];
  // Values too close together for ticks between them are treated as one value.
  if (top - bottom <= Math.max(Math.abs(top), Math.abs(bottom)) * NEAREST) {
    const room = Math.abs(top) / 10 || 1;
    [bottom, top] = [bottom - room, top + room];
  }
  const near = 3 * (top - bottom);
  for (const limit of limits) {
    if (limit > most && limit <= most + near) top = Math.max(top, limit);
    if (limit < least && limit >= least - near) bottom = Math.min(bottom, limit);
  }
  return [bottom, top];
}
