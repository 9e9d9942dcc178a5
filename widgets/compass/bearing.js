// @ts-check
/**
 * Directions over the ground as bearings: degrees clockwise from north. Pure.
 */

const POINTS = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

/**
 * Return the same direction from 0 to below 360.
 *
 * @param {number} degrees
 */
export function bearing(degrees) {
  const turned = ((degrees % 360) + 360) % 360;
  return turned === 360 ? 0 : turned + 0;
}

/**
 * Return the bearing that a robot's angle means.
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
 * Return the angle that a robot means by a bearing: the way back of `bearingOf`.
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
 * Return the shorter way from one bearing to another: -180 to 180, to the right is positive.
 *
 * @param {number} from
 * @param {number} to
 */
export function turn(from, to) {
  const way = bearing(to - from);
  return way > 180 ? way - 360 : way;
}

/**
 * Return the point of the compass that is nearest.
 *
 * @param {number} degrees
 */
export function point(degrees) {
  return POINTS[Math.round(bearing(degrees) / 45) % 8] ?? "N";
}

/**
 * Return a bearing as it is spoken: three digits, 360 never.
 *
 * @param {number | null} degrees
 */
export function figures(degrees) {
  if (degrees === null) return "—";
  return String(Math.round(bearing(degrees)) % 360).padStart(3, "0");
}

/**
 * Return the bearing at which a point of the rose lies.
 *
 * @param {number} right from the middle
 * @param {number} down from the middle
 * @param {number} up bearing that is at the top of the rose
 */
export function bearingAt(right, down, up) {
  return bearing((Math.atan2(right, -down) * 180) / Math.PI + up);
}
