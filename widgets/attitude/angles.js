// @ts-check
/**
 * The attitude of a vehicle, from the angles of its robot. Pure.
 *
 * Axes as in REP 103: FLU is x forward, y left, z up; FRD is x forward, y right, z down. Roll has the
 * same sign in both conventions. Pitch and yaw have opposite signs: a positive pitch is nose down in FLU
 * and nose up in FRD.
 *
 * @typedef {{roll: number | null, pitch: number | null, yaw: number | null}} Angles Angles in radians, in
 *   the axes of the robot; null if unknown.
 * @typedef {{bank: number | null, nose: number | null, turn: number | null}} Lean Angles in degrees: right
 *   side down, nose up, and turned to the right are positive.
 * @typedef {[number, number, number]} Point
 * @typedef {{depth: number, name: string, points: [number, number][]}} Face
 */

export const DEGREES = 180 / Math.PI;

/**
 * Return roll, pitch and yaw of an orientation (applied in the order yaw, pitch, roll).
 *
 * @param {readonly (number | null)[]} parts components of a quaternion
 * @param {string} order "xyzw" as in ROS, or "wxyz"
 * @returns {Angles | null} null for an invalid orientation
 */
export function ofQuaternion(parts, order) {
  const given = parts.slice(0, 4);
  if (given.length < 4 || given.some((part) => part === null || !Number.isFinite(part))) return null;
  const [a = 0, b = 0, c = 0, d = 0] = /** @type {number[]} */ (given);
  const size = Math.hypot(a, b, c, d);
  if (size < 1e-6) return null;
  const [x, y, z, w] = (order === "wxyz" ? [b, c, d, a] : [a, b, c, d]).map((part) => part / size);
  return ofUnit(x ?? 0, y ?? 0, z ?? 0, w ?? 1);
}

/**
 * @param {number} x
 * @param {number} y
 * @param {number} z
 * @param {number} w
 * @returns {Angles}
 */
function ofUnit(x, y, z, w) {
  const sine = Math.min(1, Math.max(-1, 2 * (w * y - z * x)));
  // With the nose straight up or down, roll and yaw have the same axis: yaw gets the whole angle.
  if (Math.abs(sine) > 1 - 1e-9) {
    const yaw = -2 * Math.sign(sine) * Math.atan2(x, w);
    return { roll: 0, pitch: (Math.sign(sine) * Math.PI) / 2, yaw };
  }
  return {
    roll: Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    pitch: Math.asin(sine),
    yaw: Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  };
}

/**
 * @param {Angles} angles
 * @param {string} axes "FLU" or "FRD"; ENU and NED have the same signs, respectively
 * @returns {Lean}
 */
export function leanOf({ roll, pitch, yaw }, axes) {
  const flip = axes === "FRD" || axes === "NED" ? 1 : -1;
  const turned = (/** @type {number | null} */ angle, /** @type {number} */ sign) =>
    angle === null ? null : sign * wrapped(angle * DEGREES) + 0;
  return { bank: turned(roll, 1), nose: turned(pitch, flip), turn: turned(yaw, flip) };
}

/**
 * Return the angle between -180 and 180.
 *
 * @param {number} degrees
 */
export function wrapped(degrees) {
  const turned = ((((degrees + 180) % 360) + 360) % 360) - 180;
  return turned === -180 && degrees > 0 ? 180 : turned;
}

/** Corners of a vehicle around the origin, as forward, right, down: 2 by 1.3 by 0.6, with a lower nose. */
const CORNERS = /** @type {Point[]} */ ([
  [-1, -0.65, 0.3],
  [-1, 0.65, 0.3],
  [1, 0.5, 0.3],
  [1, -0.5, 0.3],
  [-1, -0.65, -0.35],
  [-1, 0.65, -0.35],
  [0.7, 0.5, -0.1],
  [0.7, -0.5, -0.1],
]);
/** Each face by its corners, in order. @type {[string, number[]][]} */
const FACES = [
  ["back", [1, 0, 4, 5]],
  ["left", [0, 3, 7, 4]],
  ["right", [2, 1, 5, 6]],
  ["front", [3, 2, 6, 7]],
  ["top", [4, 7, 6, 5]],
  ["bottom", [0, 1, 2, 3]],
];
/** Viewpoint behind the vehicle, to its left, and above, in degrees. */
const LOOK = { aside: 25, down: 22 };

/**
 * Return the faces of a solid vehicle, seen from behind, the farthest first.
 *
 * @param {Lean} lean
 * @returns {Face[]} points from about -1.3 to 1.3, right and down positive
 */
export function solid({ bank, nose, turn }) {
  const seen = CORNERS.map((corner) => {
    const leant = yawed(pitched(rolled(corner, bank ?? 0), nose ?? 0), turn ?? 0);
    return pitched(yawed(leant, LOOK.aside), LOOK.down);
  });
  const faces = FACES.map(([name, corners]) => {
    const places = corners.map((corner) => /** @type {Point} */ (seen[corner]));
    const depth = facing(places);
    return { name, depth, points: places.map(([, right, down]) => /** @type {[number, number]} */ ([right, down])) };
  });
  return faces.sort((one, other) => other.depth - one.depth);
}

/**
 * Return how far a face of a convex body around the origin points away from the viewer, from -1 to 1.
 * Faces that point away are hidden by the others, so they are drawn first.
 *
 * @param {Point[]} places
 */
function facing(places) {
  const [a, b, c] = /** @type {[Point, Point, Point]} */ (places);
  const [u, v] = [b, c].map((point) => point.map((part, axis) => part - (a[axis] ?? 0)));
  const [ux = 0, uy = 0, uz = 0] = u ?? [];
  const [vx = 0, vy = 0, vz = 0] = v ?? [];
  const normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
  const outward = normal.reduce((sum, part, axis) => sum + part * (a[axis] ?? 0), 0);
  return (Math.sign(outward) * (normal[0] ?? 0)) / Math.hypot(...normal);
}

/** @param {Point} point @param {number} degrees right side down @returns {Point} */
function rolled([x, y, z], degrees) {
  const [c, s] = [Math.cos(degrees / DEGREES), Math.sin(degrees / DEGREES)];
  return [x, c * y - s * z, s * y + c * z];
}

/** @param {Point} point @param {number} degrees nose up @returns {Point} */
function pitched([x, y, z], degrees) {
  const [c, s] = [Math.cos(degrees / DEGREES), Math.sin(degrees / DEGREES)];
  return [c * x + s * z, y, c * z - s * x];
}

/** @param {Point} point @param {number} degrees to the right @returns {Point} */
function yawed([x, y, z], degrees) {
  const [c, s] = [Math.cos(degrees / DEGREES), Math.sin(degrees / DEGREES)];
  return [c * x - s * y, s * x + c * y, z];
}
