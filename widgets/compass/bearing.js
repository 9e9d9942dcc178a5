// @ts-check
/**
 * Directions over the ground as bearings: degrees clockwise from north. Pure.
 */

const POINTS = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

/**
 * Return the bearing from 0 to below 360.
 *
 * @param {number} degrees
 */
export function bearing(degrees) {
  const turned = ((degrees % 360) + 360) % 360;
  return turned === 360 ? 0 : turned + 0;
}

/**
 * Return the bearing for a robot's angle.
 *
 * @param {number} value
 * @param {string} unit "rad" or degrees
 * @param {string} convention "yaw": counter-clockwise from east, as in REP 103; else a bearing
 */
export function bearingOf(value, unit, convention) {
  const degrees = unit === "rad" ? (value * 180) / Math.PI : value;
  return bearing(convention === "yaw" ? 90 - degrees : degrees);
}

/**
 * Return the robot's angle for a bearing: the inverse of `bearingOf`.
 *
 * @param {number} degrees
 * @param {string} unit
 * @param {string} convention
 */
export function angleOf(degrees, unit, convention) {
  const own = convention === "yaw" ? turn(0, 90 - degrees) : bearing(degrees);
  return unit === "rad" ? (own * Math.PI) / 180 : own;
}

/**
 * Return the shorter turn from one bearing to another: -180 to 180, positive to the right.
 *
 * @param {number} from
 * @param {number} to
 */
export function turn(from, to) {
  const way = bearing(to - from);
  return way > 180 ? way - 360 : way;
}

/**
 * Return the nearest point of the compass.
 *
 * @param {number} degrees
 */
export function point(degrees) {
  return POINTS[Math.round(bearing(degrees) / 45) % 8] ?? "N";
}

/**
 * Return a bearing as three digits, from 000 to 359.
 *
 * @param {number | null} degrees
 */
export function figures(degrees) {
  if (degrees === null) return "—";
  return String(Math.round(bearing(degrees)) % 360).padStart(3, "0");
}

/**
 * Return the bearing of a point of the rose.
 *
 * @param {number} right distance from the middle
 * @param {number} down distance from the middle
 * @param {number} up bearing at the top of the rose
 */
export function bearingAt(right, down, up) {
  return bearing((Math.atan2(right, -down) * 180) / Math.PI + up);
}
