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
  const angle = (Math.atan2(x, -y) * 180) / Math.PI;
  return Math.min(1, Math.max(0, (angle / SWEEP + 1) / 2));
}

/**
 * The same while a finger is down: it does not leap over the gap from one end to the other.
 *
 * @param {number} x
 * @param {number} y
 * @param {number} before 0 to 1
 * @returns {number}
 */
export function sharePulled(x, y, before) {
  const share = shareAt(x, y) ?? before;
  return Math.abs(share - before) > 0.5 ? Math.round(before) : share;
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
