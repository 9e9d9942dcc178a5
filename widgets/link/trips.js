// @ts-check
/** Round-trip times of the last minutes: median, 95th percentile and quality. Pure: no DOM, no clock. */

const MOST = 120;
export const CAUTION_MS = 100;
export const POOR_MS = 250;

export class Trips {
  constructor() {
    /** @type {number[]} */
    this.all = [];
  }

  /** @param {number} ms */
  add(ms) {
    this.all.push(ms);
    if (this.all.length > MOST) this.all.shift();
  }

  /**
   * @param {number} share 0.5 for the median
   * @returns {number | null} milliseconds; null without data
   */
  share(share) {
    if (this.all.length === 0) return null;
    const sorted = this.all.toSorted((one, other) => one - other);
    return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? null;
  }

  /** Return the fraction of trips that are too slow for driving, 0 to 1; null without data. */
  late() {
    if (this.all.length === 0) return null;
    return this.all.filter((ms) => ms > POOR_MS).length / this.all.length;
  }
}

/**
 * @param {number | null} ms
 * @returns {"good" | "caution" | "bad" | ""}
 */
export function quality(ms) {
  if (ms === null) return "";
  if (ms > POOR_MS) return "bad";
  return ms > CAUTION_MS ? "caution" : "good";
}
