// @ts-check
/** Round trips of the last minutes: middle, 95 %, and how good that is. No DOM, no clock. */

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
   * @param {number} share 0.5 for the middle
   * @returns {number | null} milliseconds; null while there are none
   */
  share(share) {
    if (this.all.length === 0) return null;
    const sorted = this.all.toSorted((one, other) => one - other);
    return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? null;
  }

  /** Share of them, 0 to 1, that were too late to drive by; null while there are none. */
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
