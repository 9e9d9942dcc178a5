// @ts-check
/**
 * Speeds in common units. Pure.
 */

/** Factors from m/s. @type {Record<string, number>} */
const FACTORS = { "m/s": 1, "km/h": 3.6, kn: 3600 / 1852 };

/**
 * Return the conversion of a speed from m/s to a unit, or null for an unknown unit.
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
 * Return the magnitude of a velocity; null if a component is unknown.
 *
 * @param {readonly (number | null)[] | null} parts
 */
export function lengthOf(parts) {
  if (!parts || parts.length === 0 || parts.some((part) => part === null)) return null;
  return Math.hypot(.../** @type {number[]} */ (parts));
}
