// @ts-check
/**
 * Numbers of setpoints: bounds, steps, and the effect of keys. Pure.
 *
 * @typedef {import("../core/types.js").Argument} Argument
 */

import { symbolOf } from "../core/units.js";

/** Default range of a control. */
const ROOM = 100;

/**
 * Return the range and the steps of a control.
 *
 * @param {Argument | undefined} argument
 * @param {{step?: unknown, min?: unknown, max?: unknown, unit?: unknown, precision?: unknown}} options
 * @returns {{min: number, max: number, step: number, digits: number, unit: string}}
 */
export function boundsOf(argument, options) {
  const [least, most] = [argument?.min ?? -Infinity, argument?.max ?? Infinity];
  const inside = (/** @type {number} */ value) => Math.min(most, Math.max(least, value));
  // An option may narrow the command's range, but never widen it.
  const lowest = typeof options.min === "number" ? inside(options.min) : argument?.min;
  const highest = typeof options.max === "number" ? inside(options.max) : argument?.max;
  // Without bounds, the range is 0 to 100; with one bound, it is 100 wide.
  const min = lowest ?? ((highest ?? ROOM) > 0 ? 0 : (highest ?? 0) - ROOM);
  const max = highest ?? (min < ROOM ? ROOM : min + ROOM);
  const isWhole = argument?.type === "integer";
  const usual = isWhole ? Math.max(1, Math.round((max - min) / 100)) : niceStep((max - min) / 100);
  const step = typeof options.step === "number" && options.step > 0 ? options.step : usual;
  const digits = typeof options.precision === "number" ? options.precision : digitsOf(step);
  const unit = typeof options.unit === "string" ? options.unit : (argument?.unit ?? "");
  return { min, max: Math.max(min, max), step, digits: isWhole ? 0 : digits, unit: symbolOf(unit) };
}

/**
 * Return the nearest value on the grid of steps, within the bounds.
 *
 * @param {number} value
 * @param {{min: number, max: number, step: number}} bounds
 */
export function snapped(value, { min, max, step }) {
  const near = min + Math.round((value - min) / step) * step;
  const inside = Math.min(max, Math.max(min, near));
  return Number(inside.toFixed(10));
}

/**
 * Return the value after a key of a slider; null for other keys.
 *
 * @param {string} key
 * @param {number} value
 * @param {{min: number, max: number, step: number}} bounds
 * @returns {number | null}
 */
export function keyed(key, value, bounds) {
  const { min, max, step } = bounds;
  switch (key) {
    case "ArrowRight":
    case "ArrowUp":
      return snapped(value + step, bounds);
    case "ArrowLeft":
    case "ArrowDown":
      return snapped(value - step, bounds);
    case "PageUp":
      return snapped(value + Math.max(step, (max - min) / 10), bounds);
    case "PageDown":
      return snapped(value - Math.max(step, (max - min) / 10), bounds);
    case "Home":
      return min;
    case "End":
      return max;
    default:
      return null;
  }
}

/** @param {number} step rounded up to 1, 2 or 5 of a decade */
function niceStep(step) {
  if (!(step > 0) || !Number.isFinite(step)) return 1;
  const decade = 10 ** Math.floor(Math.log10(step));
  const share = step / decade;
  const nice = share <= 1 ? 1 : share <= 2 ? 2 : share <= 5 ? 5 : 10;
  return Number((nice * decade).toPrecision(3));
}

/** @param {number} step */
function digitsOf(step) {
  const text = String(step);
  if (text.includes("e-")) return Number(text.split("e-")[1]);
  return text.split(".")[1]?.length ?? 0;
}
