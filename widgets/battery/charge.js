// @ts-check
/**
 * Computations on the values of a battery. Pure.
 */

/**
 * Return the remaining time of the charge.
 *
 * @param {number | null} level percent
 * @param {number | null} current amperes; negative while discharging, as in ROS
 * @param {unknown} capacity ampere hours
 * @returns {number | null} seconds; null if unknown, for example while charging
 */
export function timeLeft(level, current, capacity) {
  if (level === null || current === null || typeof capacity !== "number") return null;
  // With almost no current, the result would be unrealistically long.
  if (current > -capacity / 1000) return null;
  return (3600 * capacity * Math.max(0, level)) / 100 / -current;
}

/**
 * Return hours and minutes for texts such as "2 h 05 min", "7 min", "under 1 min".
 *
 * @param {number} seconds
 * @returns {{hours: number, minutes: number}}
 */
export function clock(seconds) {
  const minutes = Math.max(0, Math.floor(seconds / 60));
  return { hours: Math.floor(minutes / 60), minutes: minutes % 60 };
}

/**
 * Return the highest minus the lowest cell; null if fewer than two are known.
 *
 * @param {readonly (number | null)[]} cells
 */
export function spread(cells) {
  const known = cells.filter((cell) => cell !== null);
  return known.length < 2 ? null : Math.max(...known) - Math.min(...known);
}

/**
 * Return the values of an empty and a full cell.
 *
 * @param {{unit?: string | undefined, min?: number | undefined, max?: number | undefined}} signal
 * @param {{cell_min?: unknown, cell_max?: unknown}} options
 * @returns {[number, number]}
 */
export function cellScale({ unit, min, max }, options) {
  // The default is a lithium cell; options override the default.
  const [empty, full] = unit === "V" ? [3, 4.2] : [0, 100];
  const least = typeof options.cell_min === "number" ? options.cell_min : (min ?? empty);
  const most = typeof options.cell_max === "number" ? options.cell_max : (max ?? full);
  return most > least ? [least, most] : [least, least + 1];
}

/**
 * A running mean over a few seconds, so that the remaining time does not jump at each motor start.
 */
export class Mean {
  /** @param {number} seconds */
  constructor(seconds) {
    this.seconds = seconds;
    /** @type {number | null} */
    this.value = null;
    this.time = 0;
  }

  /**
   * @param {number | null} value null starts again with the next value
   * @param {number} time in seconds
   */
  add(value, time) {
    if (value === null || this.value === null) this.value = value;
    else {
      const weight = 1 - Math.exp(-Math.max(0, time - this.time) / this.seconds);
      this.value += weight * (value - this.value);
    }
    this.time = time;
    return this.value;
  }
}
