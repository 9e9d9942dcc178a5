// @ts-check
/**
 * The scale of a radio's signal strength. Pure.
 */

/** Thresholds of 1, 2, 3 and 4 bars in dBm; usual for Wi-Fi. */
const STEPS = [-85, -75, -65, -55];
/** Range of the drawn history. @type {Record<string, [number, number]>} */
const ENDS = { "%": [0, 100], dBm: [-100, -30] };

/**
 * Return the number of lit bars, 0 to 4.
 *
 * @param {number} value
 * @param {string} unit "%" or dBm
 */
export function bars(value, unit) {
  if (unit === "%") return Math.min(4, Math.max(0, Math.ceil(value / 25)));
  return STEPS.filter((step) => value >= step).length;
}

/** The last minute: one value a second, the oldest first. */
export class Minute {
  constructor() {
    /** @type {{second: number, value: number}[]} */
    this.points = [];
  }

  /**
   * @param {number} time in seconds
   * @param {number} value strength; the lowest value of each second is kept, because it matters most
   * @returns {boolean} whether the drawing has changed
   */
  add(time, value) {
    const second = Math.floor(time);
    const last = this.points.at(-1);
    if (last && last.second === second) {
      if (value >= last.value) return false;
      last.value = value;
      return true;
    }
    this.points.push({ second, value });
    while ((this.points[0]?.second ?? second) < second - 60) this.points.shift();
    return true;
  }

  /**
   * Return the path of the minute in a box 60 wide and 20 high, with gaps for missing seconds.
   *
   * @param {number} time now, in seconds
   * @param {string} unit
   */
  path(time, unit) {
    const [least, most] = ENDS[unit] ?? ENDS["dBm"] ?? [0, 1];
    let path = "";
    let was = -Infinity;
    for (const { second, value } of this.points) {
      const x = 60 - (Math.floor(time) - second);
      if (x < 0) continue;
      const y = 20 - (20 * (Math.min(most, Math.max(least, value)) - least)) / (most - least);
      path += `${second - was > 5 ? "M" : "L"}${x} ${y.toFixed(1)}`;
      was = second;
    }
    return path;
  }
}
