// @ts-check
/**
 * The directions of the rays of a scan: at even steps, or one angle per ray. Pure: no DOM.
 *
 * Angles are radians from straight ahead, counter-clockwise (REP 103).
 *
 * @typedef {object} Fan
 * @property {number} count number of rays
 * @property {(index: number) => number} angleAt returns the angle of a ray in radians; NaN if unknown
 * @property {(angle: number) => number} rayAt returns the ray in a direction of any turn, or NO_RAY
 * @property {(share: number) => number} across returns the ray at a fraction of the way from the left to
 *   the right end, or NO_RAY
 *
 * @typedef {object} Fault Reason why the rays have no directions: a translatable text, and its names.
 * @property {string} text
 * @property {Record<string, number>} names
 */

const TURN = 2 * Math.PI;
/** Value that means “no ray”. */
export const NO_RAY = 0xffff;

/** Return the angle from 0 to below a full turn. @param {number} angle radians */
const within = (angle) => ((angle % TURN) + TURN) % TURN;

/** Rays at even steps. @implements {Fan} */
export class Even {
  /**
   * @param {number} count
   * @param {number} start radians of the first ray
   * @param {number} step radians between two rays; negative for clockwise rays
   */
  constructor(count, start, step) {
    this.count = count;
    this.start = start;
    this.step = step;
  }

  /** @param {number} index */
  angleAt(index) {
    return this.start + this.step * index;
  }

  /** @param {number} angle */
  rayAt(angle) {
    const { count, start, step } = this;
    if (count === 0 || step === 0) return NO_RAY;
    const along = within((angle - start) * Math.sign(step));
    const index = Math.round(along / Math.abs(step));
    if (index < count) return index;
    // Just before the first ray still counts as the first ray.
    return TURN - along <= Math.abs(step) / 2 ? 0 : NO_RAY;
  }

  /** @param {number} share */
  across(share) {
    if (this.count === 0) return NO_RAY;
    // Counter-clockwise rays run from right to left.
    const along = this.step > 0 ? 1 - share : share;
    return Math.min(this.count - 1, Math.round(along * (this.count - 1)));
  }
}

/** Number of directions in the look-up table of uneven rays: a tenth of a degree each. */
const DIRECTIONS = 3600;
/** Gap between rays, relative to the usual gap, above which the sector between them is blind. */
const JOINED = 3;
/** Largest half sector of a ray, because a few sensors do not cover a full turn. */
const WIDEST = Math.PI / 4;

/** Rays at individual angles, in any order. @implements {Fan} */
export class Uneven {
  /** @param {readonly unknown[]} angles radians of each ray; other values give rays without direction */
  constructor(angles) {
    this.count = angles.length;
    this.angles = Float64Array.from(angles, (each) => (isAngle(each) ? each : NaN));
    /** Ray of each direction. */
    this.rays = new Uint16Array(DIRECTIONS).fill(NO_RAY);
    /** Left end, and angle from there to the right end: a full turn, with straight ahead in the middle. */
    this.left = Math.PI;
    this.extent = TURN;
    this.place();
  }

  place() {
    const around = [...this.angles.keys()]
      .filter((index) => isAngle(this.angles[index]))
      .map((index) => ({ index, angle: within(this.angleAt(index)) }))
      .sort((one, other) => one.angle - other.angle);
    /** Gap from each ray to the next ray counter-clockwise; a full turn for a single ray. */
    const gaps = around.map(({ angle }, at) => (around[at + 1]?.angle ?? (around[0]?.angle ?? 0) + TURN) - angle);
    const ordered = gaps.filter((gap) => gap > 0).sort((one, other) => one - other);
    const usual = ordered[(ordered.length - 1) >> 1] ?? TURN;
    const half = (/** @type {number} */ gap) => Math.min((gap > JOINED * usual ? usual : gap) / 2, WIDEST);
    around.forEach(({ index, angle }, at) => {
      this.fill(angle - half(gaps.at(at - 1) ?? TURN), angle + half(gaps[at] ?? TURN), index);
    });
    // Rays can be closer together than the table's directions; each ray still gets a direction of its own.
    for (const { index, angle } of around) this.rays[directionOf(angle)] = index;
    const widest = Math.max(0, ...gaps);
    const at = gaps.indexOf(widest);
    if (widest <= JOINED * usual) return;
    this.left = around[at]?.angle ?? 0;
    this.extent = TURN - widest;
  }

  /**
   * @param {number} from radians
   * @param {number} to
   * @param {number} index
   */
  fill(from, to, index) {
    const [first, last] = [from, to].map((angle) => (angle / TURN) * DIRECTIONS);
    for (let direction = Math.ceil(first ?? 0); direction <= (last ?? 0); direction += 1) {
      this.rays[(direction + DIRECTIONS) % DIRECTIONS] = index;
    }
  }

  /** @param {number} index */
  angleAt(index) {
    return this.angles[index] ?? NaN;
  }

  /** @param {number} angle */
  rayAt(angle) {
    return this.rays[directionOf(angle)] ?? NO_RAY;
  }

  /** @param {number} share */
  across(share) {
    return this.rayAt(this.left - share * this.extent);
  }
}

/** @param {number} angle radians, any turn */
function directionOf(angle) {
  return Math.round((within(angle) / TURN) * DIRECTIONS) % DIRECTIONS;
}

/**
 * @param {unknown} value
 * @returns {value is number}
 */
function isAngle(value) {
  return typeof value === "number" && Number.isFinite(value);
}

/**
 * Mark a text for the catalogues; it is translated elsewhere.
 *
 * @param {string} text
 */
const mark = (text) => text;

/**
 * Return the reason why these angles do not fit these distances, or null if they do. An angle may be
 * missing if the distance is missing too.
 *
 * @param {readonly unknown[]} angles
 * @param {readonly unknown[]} ranges
 * @returns {Fault | null}
 */
export function faultOf(angles, ranges) {
  if (angles.length !== ranges.length) {
    const names = { angles: angles.length, distances: ranges.length };
    return { text: mark("▲ {angles} angles for {distances} distances"), names };
  }
  const isMeasured = (/** @type {unknown} */ value) => typeof value === "number" && !Number.isNaN(value);
  const at = angles.findIndex((each, index) => !isAngle(each) && isMeasured(ranges[index]));
  if (at < 0) return null;
  return { text: mark("▲ angle {place} of {count} is not a number"), names: { place: at + 1, count: angles.length } };
}
