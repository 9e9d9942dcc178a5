// @ts-check
/**
 * Values and ages as texts for people. Knows no store and no DOM.
 *
 * @typedef {import("./types.js").Held} Held
 * @typedef {import("./types.js").Signal} Signal
 */

export const DASH = "—";

/**
 * @param {Held} value
 * @param {Signal} signal
 * @returns {string}
 */
export function textOf(value, signal) {
  if (value === null) return DASH;
  if (typeof value === "number") {
    return signal.precision === undefined ? spoken(value, signal) : value.toFixed(signal.precision);
  }
  if (Array.isArray(value)) return value.map((each) => textOf(each, signal)).join(", ");
  return typeof value === "object" ? JSON.stringify(value) : spoken(value, signal);
}

/**
 * @param {string | number | boolean} value
 * @param {Signal} signal
 */
function spoken(value, signal) {
  const text = typeof value === "number" ? figure(value) : String(value);
  return signal.states && Object.hasOwn(signal.states, text) ? (signal.states[text] ?? text) : text;
}

/**
 * A conversion must not bring digits that mean nothing: 0.30000000000000004 is 0.3.
 *
 * @param {number} value
 */
function figure(value) {
  return Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(15)));
}

/**
 * Whole numbers only: a reader wants to know "old", not tenths.
 *
 * @param {number} seconds
 */
export function ageText(seconds) {
  if (seconds < 1) return "< 1 s";
  if (seconds < 60) return `${Math.floor(seconds)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h`;
}
