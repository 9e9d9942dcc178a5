// @ts-check
/**
 * The trend of a value, separated from its noise. Pure.
 */

/** Maximum number of readings. Newer readings in between replace the last reading. */
const POINTS = 60;
/** Minimum number of readings for a trend. */
const LEAST_POINTS = 4;

export class Trend {
  /** @param {number} spanS time span of the trend, in seconds */
  constructor(spanS) {
    this.spanS = spanS;
    /** @type {{time: number, value: number}[]} */
    this.points = [];
  }

  /** Forget all readings, for example after a gap. */
  clear() {
    this.points = [];
  }

  /**
   * @param {number} time in seconds
   * @param {number} value
   */
  add(time, value) {
    const last = this.points.at(-1);
    if (last && time <= last.time) return;
    const before = this.points.at(-2);
    if (last && before && time - before.time < this.spanS / POINTS) this.points.pop();
    this.points.push({ time, value });
    while ((this.points[0]?.time ?? time) < time - this.spanS) this.points.shift();
  }

  /**
   * Return 1 for a rise, -1 for a fall, 0 for a steady value, and null if unknown.
   *
   * A value rises if its regression line rises over the span by more than twice the scatter around it, and
   * by more than `least`.
   *
   * @param {number} [least] smallest relevant change over the span
   * @returns {-1 | 0 | 1 | null}
   */
  direction(least = 0) {
    const { points } = this;
    if (points.length < LEAST_POINTS) return null;
    const count = points.length;
    const middleTime = points.reduce((sum, { time }) => sum + time, 0) / count;
    const middle = points.reduce((sum, { value }) => sum + value, 0) / count;
    let [across, together] = [0, 0];
    for (const { time, value } of points) {
      across += (time - middleTime) ** 2;
      together += (time - middleTime) * (value - middle);
    }
    if (across === 0) return null;
    const slope = together / across;
    const scatter = Math.sqrt(
      points.reduce((sum, { time, value }) => sum + (value - middle - slope * (time - middleTime)) ** 2, 0) / count,
    );
    const change = slope * ((points.at(-1)?.time ?? 0) - (points[0]?.time ?? 0));
    if (Math.abs(change) <= Math.max(least, 2 * scatter, 1e-12)) return 0;
    return change > 0 ? 1 : -1;
  }
}
