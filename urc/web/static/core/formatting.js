// @ts-check
/**
 * Values and ages as text. The module uses no store and no DOM.
 *
 * @typedef {import("./types.js").Held} Held
 * @typedef {import("./types.js").Signal} Signal
 */
import { figure } from "./number_format.js";

export const DASH = "—";

/**
 * @param {Held} value in the signal's unit
 * @param {Signal} signal
 * @param {(value: number) => number} [factor] conversion to the displayed unit
 * @returns {string}
 */
export function textOf(value, signal, factor) {
  if (value === null) return DASH;
  if (Array.isArray(value)) return value.map((each) => textOf(each, signal, factor)).join(", ");
  if (typeof value === "number") {
    const own = figure(value, undefined);
    const word = signal.precision === undefined ? wordOf(signal, own) : own;
    return word === own ? figure(value, signal.precision, factor) : word;
  }
  return typeof value === "object" ? JSON.stringify(value) : wordOf(signal, value);
}

/**
 * Return the word for a value of a signal with `states`. Commands use the values that the robot
 * sends.
 *
 * @param {Pick<Signal, "states"> | undefined} signal
 * @param {unknown} value value from the robot, or a word
 */
export function wordOf(signal, value) {
  const states = signal?.states ?? {};
  const text = String(value);
  return Object.hasOwn(states, text) ? (states[text] ?? text) : text;
}

/**
 * Return short words in sequence; lines may only break between words.
 *
 * @param {readonly string[]} words
 */
export function inTurn(words) {
  return words.map((each) => each.replaceAll(" ", "\u00a0")).join(" ");
}

/**
 * Return an age in whole numbers, because tenths do not matter.
 *
 * @param {number} seconds
 */
export function ageText(seconds) {
  if (seconds < 1) return "< 1 s";
  if (seconds < 60) return `${Math.floor(seconds)} s`;
  if (seconds < 3600) return `${Math.floor(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h`;
}
