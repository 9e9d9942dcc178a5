// @ts-check
/**
 * The arithmetic of scales, for every widget that draws one: `import { ticks } from "urc/scale"`.
 *
 * Pure: knows no page, so that it is tested without one.
 *
 * @typedef {import("../core/types.js").Alarm} Alarm
 * @typedef {import("../core/types.js").Signal} Signal
 *
 * @typedef {{from: number, to: number, alarm: Alarm}} Band A part of a scale in which a value has
 *   passed a limit; `from` and `to` in the scale's unit.
 */

/** Tick distances that people read with ease, within a decade. */
const STEPS = [1, 2, 5, 10];

/** Numbers whose difference is a smaller share of them are drawn as one. */
const NEAREST = 1e-12;

/**
 * Return where a value stands on a scale, as a share from 0 to 1; ends clamp.
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
 * Return round values of a scale, both ends included where they are round.
 *
 * @param {number} least
 * @param {number} most
 * @param {number} count about how many; never more than twice as many
 * @returns {number[]} rising
 */
export function ticks(least, most, count) {
  if (!(most > least) || !Number.isFinite(most - least)) return [];
  const rough = (most - least) / Math.max(1, count);
  const decade = 10 ** Math.floor(Math.log10(rough));
  const step = decade * (STEPS.find((each) => each * decade >= rough * 0.999) ?? 10);
  // Multiplied, not added up: ten times 0.1 is not 1.
  const places = wholes(Math.ceil(least / step - 1e-9), Math.floor(most / step + 1e-9));
  return places.map((place) => Number((place * step).toPrecision(12)) + 0);
}

/**
 * Return the whole numbers from one to another, both included; none so far from zero that a number and
 * the next one are not told apart.
 *
 * @param {number} first
 * @param {number} last
 * @returns {number[]} rising
 */
export function wholes(first, last) {
  if (!Number.isSafeInteger(first) || !Number.isSafeInteger(last)) return [];
  return Array.from({ length: Math.max(0, last - first + 1) }, (_, index) => first + index);
}

/**
 * Return how many digits after the point such round values need.
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
 * Return the ends of a scale: what was asked for, else what the signal can be, else 0 to 100 for
 * percent and 0 to 1.
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
 * Return the parts of a scale that lie past a limit.
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
 * Return what a drawing goes from and to so that all values are seen, with the limits that are near.
 *
 * @param {number} least of the values
 * @param {number} most of the values
 * @param {readonly number[]} limits those further off than three times the height are left out
 * @returns {[number, number]}
 */
export function spanOf(least, most, limits) {
  if (!(most >= least)) return [0, 1];
  let [bottom, top] = [least, most];
  // Too near each other to be counted between: as good as one value.
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
