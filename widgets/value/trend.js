// @ts-check
/**
 * Whether a value rises or falls, told apart from its noise. Pure.
 */

/** At most so many readings are kept; newer ones in between replace the last. */
const POINTS = 60;
/** Fewer say nothing. */
const LEAST_POINTS = 4;

export class Trend {
  /** @param {number} spanS over which it is looked at, in seconds */
  constructor(spanS) {
    this.spanS = spanS;
    /** @type {{time: number, value: number}[]} */
    this.points = [];
  }

  /** Forget everything, as after a gap. */
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
   * Return 1 when it rises, -1 when it falls, 0 when it is steady, null when that is not known.
   *
   * It rises when the line through the points climbs over the span by more than twice of what they
   * scatter about it, and by more than `least`.
   *
   * @param {number} [least] change over the span that means something
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
