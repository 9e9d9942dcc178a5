// @ts-check
/**
 * Values and ages as texts for people. Knows no store and no DOM.
 *
 * @typedef {import("./types.js").Held} Held
 * @typedef {import("./types.js").Signal} Signal
 */
import { figure } from "./figures.js";

export const DASH = "—";

/**
 * @param {Held} value in the signal's unit
 * @param {Signal} signal
 * @param {(value: number) => number} [factor] to the unit that people want to see
 * @returns {string}
 */
export function textOf(value, signal, factor) {
  if (value === null) return DASH;
  if (Array.isArray(value)) return value.map((each) => textOf(each, signal, factor)).join(", ");
  if (typeof value === "number") {
    const word = signal.precision === undefined ? wordOf(figure(value, undefined), signal) : undefined;
    return word ?? figure(value, signal.precision, factor);
  }
  return typeof value === "object" ? JSON.stringify(value) : (wordOf(String(value), signal) ?? String(value));
}

/**
 * @param {string} text
 * @param {Signal} signal
 */
function wordOf(text, { states }) {
  return states && Object.hasOwn(states, text) ? states[text] : undefined;
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
