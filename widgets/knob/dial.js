// @ts-check
/** The geometry of a dial of 270 degrees, from the lower left over the top. Pure: no DOM. */

/** Angle between the top and each end, in degrees. */
export const SWEEP = 135;
/** Fraction of the radius below which a pointer has no direction. */
const BLIND = 0.25;

/**
 * @param {number} share 0 to 1
 * @returns {number} degrees from the top, clockwise
 */
export function angleOf(share) {
  return (2 * share - 1) * SWEEP;
}

/**
 * Return the share at a pointer; null in the middle, and in the gap between the ends.
 *
 * @param {number} x to the right of the middle, in radii
 * @param {number} y below the middle, in radii
 * @returns {number | null} 0 to 1
 */
export function shareAt(x, y) {
  if (Math.hypot(x, y) < BLIND) return null;
  return shareOf(degrees(x, y));
}

/** A drag of the dial's hand. */
export class Pull {
  /** @param {number} share position of the hand, 0 to 1 */
  constructor(share) {
    /** Angle of the pointer. Beyond an end, the pointer is in the gap or has crossed the gap. */
    this.angle = angleOf(share);
    /** Whether the pointer has visited the middle since its last direction. */
    this.isAstray = false;
  }

  /**
   * Follow the pointer, but never across the gap from one end to the other. A pointer that leaves the
   * middle counts as a new press.
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

  /** Turn the shorter way. @param {number} way in degrees */
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
