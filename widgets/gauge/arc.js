// @ts-check
/**
 * The geometry of a round scale: 270 degrees, open below. Pure.
 */

/** Angle of the start of the scale, clockwise from straight up, in degrees. */
export const START = -135;
export const SWEEP = 270;

/**
 * Return the angle of a share of the scale, in degrees clockwise from straight up.
 *
 * @param {number} share 0 to 1
 */
export function angle(share) {
  return START + SWEEP * share;
}

/**
 * Return a point of a circle around the origin, for an SVG path.
 *
 * @param {number} degrees clockwise from straight up
 * @param {number} radius
 */
export function place(degrees, radius) {
  const radians = (degrees * Math.PI) / 180;
  const [x, y] = [radius * Math.sin(radians), -radius * Math.cos(radians)];
  return `${x.toFixed(2)} ${y.toFixed(2)}`;
}

/** The needle that points straight up. */
const NEEDLE = /** @type {const} */ ([[-4, 0], [-1.5, -74], [1.5, -74], [4, 0]]);

/**
 * Return the points of the needle for an SVG polygon.
 *
 * @param {number} degrees clockwise from straight up
 */
export function needle(degrees) {
  const radians = (degrees * Math.PI) / 180;
  const [sin, cos] = [Math.sin(radians), Math.cos(radians)];
  return NEEDLE.map(([x, y]) => `${(x * cos - y * sin).toFixed(2)},${(x * sin + y * cos).toFixed(2)}`).join(" ");
}

/**
 * Return the path of an arc between two shares of the scale.
 *
 * @param {number} from 0 to 1
 * @param {number} to not less than `from`
 * @param {number} radius
 */
export function arc(from, to, radius) {
  const isLarge = (to - from) * SWEEP > 180 ? 1 : 0;
  return `M${place(angle(from), radius)}A${radius} ${radius} 0 ${isLarge} 1 ${place(angle(to), radius)}`;
}

/**
 * Return the path of tick marks across the rim.
 *
 * @param {readonly number[]} shares
 * @param {number} inner
 * @param {number} outer
 */
export function dashes(shares, inner, outer) {
  return shares
    .map((share) => `M${place(angle(share), inner)}L${place(angle(share), outer)}`)
    .join("");
}
