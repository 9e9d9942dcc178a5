// @ts-check
/**
 * Speeds in the units that people use. Pure.
 */

/** From m/s. @type {Record<string, number>} */
const FACTORS = { "m/s": 1, "km/h": 3.6, kn: 3600 / 1852 };

/**
 * Return how a speed in m/s is shown in a unit, or null when it is none that we know.
 *
 * @param {unknown} unit
 * @returns {{symbol: string, factor: (value: number) => number} | null}
 */
export function shownIn(unit) {
  const symbol = String(unit);
  const factor = Object.hasOwn(FACTORS, symbol) ? FACTORS[symbol] : undefined;
  return factor === undefined ? null : { symbol, factor: (value) => value * factor };
}

/**
 * Return the length of a velocity; null when one of its parts is not known.
 *
 * @param {readonly (number | null)[] | null} parts
 */
export function lengthOf(parts) {
  if (!parts || parts.length === 0 || parts.some((part) => part === null)) return null;
  return Math.hypot(.../** @type {number[]} */ (parts));
}
