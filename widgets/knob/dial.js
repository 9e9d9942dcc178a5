// @ts-check
/** The geometry of a dial that goes three quarters round, from lower left over the top. No DOM. */

/** Degrees from the top, clockwise, at which it begins and ends. */
export const SWEEP = 135;
/** A finger nearer to the middle than this share of the radius points nowhere. */
const BLIND = 0.25;

/**
 * @param {number} share 0 to 1
 * @returns {number} degrees from the top, clockwise
 */
export function angleOf(share) {
  return (2 * share - 1) * SWEEP;
}

/**
 * Where a finger points; null in the middle, and in the gap below the ends' halves.
 *
 * @param {number} x to the right of the middle, in radii
 * @param {number} y below the middle, in radii
 * @returns {number | null} 0 to 1
 */
export function shareAt(x, y) {
  if (Math.hypot(x, y) < BLIND) return null;
  return shareOf(degrees(x, y));
}

/** A finger that pulls the hand of a dial. */
export class Pull {
  /** @param {number} share where the hand is, 0 to 1 */
  constructor(share) {
    /** Of the finger: beyond an end it is in the gap, or has come through it. */
    this.angle = angleOf(share);
    /** Whether the finger is in the middle, or has been since it last pointed somewhere. */
    this.isAstray = false;
  }

  /**
   * Follow the finger, but not over the gap from one end to the other: out of the middle it points
   * anew, as a finger that is put down.
   *
   * @param {number} x to the right of the middle, in radii
   * @param {number} y below the middle, in radii
   * @returns {number} 0 to 1
   */
  to(x, y) {
    const angle = degrees(x, y);
    if (Math.hypot(x, y) < BLIND) this.isAstray = true;
    else if (!this.isAstray) this.turn(angle - this.angle);
    else if (Math.abs(angle) <= SWEEP) {
      this.angle = angle;
      this.isAstray = false;
    }
    return shareOf(this.angle);
  }

  /** Go the shorter way. @param {number} way in degrees */
  turn(way) {
    const shorter = Math.abs(way) > 180 ? way - 360 * Math.sign(way) : way;
    this.angle = Math.min(180, Math.max(-180, this.angle + shorter));
  }
}

/** @param {number} angle */
function shareOf(angle) {
  return Math.min(1, Math.max(0, (angle / SWEEP + 1) / 2));
}

/**
 * @param {number} x
 * @param {number} y
 */
function degrees(x, y) {
  return (Math.atan2(x, -y) * 180) / Math.PI;
}

/**
 * @param {number} radius
 * @param {number} from share
 * @param {number} to share
 * @returns {string} an SVG path
 */
export function arc(radius, from, to) {
  const [x0, y0] = point(radius, from);
  const [x1, y1] = point(radius, to);
  const isLarge = Math.abs(to - from) * 2 * SWEEP > 180;
  return `M${x0} ${y0}A${radius} ${radius} 0 ${isLarge ? 1 : 0} ${to >= from ? 1 : 0} ${x1} ${y1}`;
}

/**
 * @param {number} inner
 * @param {number} outer
 * @param {number} share
 */
export function ray(inner, outer, share) {
  return `M${point(inner, share).join(" ")}L${point(outer, share).join(" ")}`;
}

/**
 * @param {number} radius
 * @param {number} share
 * @returns {[number, number]}
 */
function point(radius, share) {
  const angle = (angleOf(share) * Math.PI) / 180;
  return [round(radius * Math.sin(angle)), round(-radius * Math.cos(angle))];
}

/** @param {number} value */
function round(value) {
  return Math.round(value * 100) / 100 + 0;
}
