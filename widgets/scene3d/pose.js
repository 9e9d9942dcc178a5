// @ts-check
/**
 * The pose of a model in the scene, and the viewpoint. Pure: no DOM, no three.js.
 *
 * The scene has the axes of REP 103: x ahead, y left, z up, right-handed. Quaternions are [x, y, z, w].
 *
 * @typedef {[number, number, number]} Vector
 * @typedef {[number, number, number, number]} Quaternion
 * @typedef {"FLU" | "FRD"} Convention
 */

/**
 * Mark a text for the catalogues; it is translated elsewhere.
 *
 * @param {string} text
 */
const mark = (text) => text;
/** Names of a rotation in both directions. @typedef {[string, string]} Names */
/** @type {Names} */
const ROLL = [mark("right side down {n}°"), mark("left side down {n}°")];
/** @type {Names} */
const PITCH = [mark("nose down {n}°"), mark("nose up {n}°")];
/** @type {Names} */
const YAW = [mark("turned left {n}°"), mark("turned right {n}°")];

/**
 * @param {Quaternion} a
 * @param {Quaternion} b
 * @returns {Quaternion} rotation by b, then by a
 */
export function times([ax, ay, az, aw], [bx, by, bz, bw]) {
  return [
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
    aw * bw - ax * bx - ay * by - az * bz,
  ];
}

/**
 * Return the rotation by roll, then pitch, then yaw about fixed axes, in radians.
 *
 * @param {number} roll
 * @param {number} pitch
 * @param {number} yaw
 * @param {Convention} convention in FRD, pitch and yaw have the opposite sign
 * @returns {Quaternion}
 */
export function fromAngles(roll, pitch, yaw, convention) {
  const sense = convention === "FRD" ? -1 : 1;
  const half = (/** @type {number} */ angle) => [Math.sin(angle / 2), Math.cos(angle / 2)];
  const [rs = 0, rc = 1] = half(roll);
  const [ps = 0, pc = 1] = half(sense * pitch);
  const [ys = 0, yc = 1] = half(sense * yaw);
  return times([0, 0, ys, yc], times([0, ps, 0, pc], [rs, 0, 0, rc]));
}

/**
 * Return an orientation from a robot: an array of x, y, z, w or an object with these names; null if
 * invalid.
 *
 * @param {unknown} value
 * @param {Convention} convention
 * @returns {Quaternion | null}
 */
export function fromOrientation(value, convention) {
  const parts = Array.isArray(value)
    ? value
    : typeof value === "object" && value !== null
      ? ["x", "y", "z", "w"].map((name) => Reflect.get(value, name))
      : [];
  const numbers = parts.map((part) => (typeof part === "number" ? part : NaN));
  const length = Math.hypot(...numbers);
  if (numbers.length !== 4 || !(length > 1e-6)) return null;
  const [x = 0, y = 0, z = 0, w = 1] = numbers.map((part) => part / length);
  return convention === "FRD" ? [x, -y, -z, w] : [x, y, z, w];
}

/**
 * Return a vector rotated by a quaternion.
 *
 * @param {Vector} vector
 * @param {Quaternion} turn
 * @returns {Vector}
 */
export function turned([x, y, z], turn) {
  const [a, b, c, d] = turn;
  const [rx, ry, rz] = times(times(turn, [x, y, z, 0]), [-a, -b, -c, d]);
  return [rx, ry, rz];
}

/**
 * Return roll, pitch and yaw in radians, in FLU.
 *
 * @param {Quaternion} turn
 */
export function angles([x, y, z, w]) {
  const pitch = Math.asin(Math.max(-1, Math.min(1, 2 * (w * y - z * x))));
  return {
    roll: Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    pitch,
    yaw: Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
  };
}

/**
 * Return a pose in words, with whole degrees. FLU pitch is positive with the nose down.
 *
 * @param {Quaternion} turn
 * @returns {{text: string, degrees: number}[]} rotations of at least one degree
 */
export function posture(turn) {
  const { roll, pitch, yaw } = angles(turn);
  const degrees = (/** @type {number} */ angle) => Math.round((angle * 180) / Math.PI);
  /** @type {[number, string, string][]} */
  const rows = [
    [degrees(roll), mark("right side down {n}°"), mark("left side down {n}°")],
    [degrees(pitch), mark("nose down {n}°"), mark("nose up {n}°")],
    [degrees(yaw), mark("turned left {n}°"), mark("turned right {n}°")],
  ];
  return rows
    .filter(([angle]) => angle !== 0)
    .map(([angle, plus, minus]) => ({ text: angle > 0 ? plus : minus, degrees: Math.abs(angle) }));
}

/**
 * Return the position of the camera around its target.
 *
 * @param {"follow" | "top" | "orbit"} view
 * @param {number} yaw yaw of the robot, radians
 * @param {number} size size of the target, in metres
 * @returns {Vector}
 */
export function cameraAt(view, yaw, size) {
  const far = Math.max(0.2, size) * 1.7;
  if (view === "top") return [0, 0, far * 1.2];
  if (view === "follow") return [-Math.cos(yaw) * far, -Math.sin(yaw) * far, far * 0.6];
  return [far * 0.75, -far * 0.75, far * 0.6];
}

/**
 * Return a flat list of points for three.js, evenly thinned to at most `most`, without invalid points.
 *
 * @param {readonly unknown[]} values x, y, z of each
 * @param {number} most
 * @param {Convention} convention
 */
export function cloud(values, most, convention) {
  const count = Math.floor(values.length / 3);
  const every = Math.max(1, Math.ceil(count / Math.max(1, most)));
  const sense = convention === "FRD" ? -1 : 1;
  const points = new Float32Array(3 * Math.ceil(count / every));
  let filled = 0;
  for (let index = 0; index < count; index += every) {
    const [x, y, z] = [values[3 * index], values[3 * index + 1], values[3 * index + 2]];
    if (typeof x !== "number" || typeof y !== "number" || typeof z !== "number") continue;
    points.set([x, sense * y, sense * z], filled);
    filled += 3;
  }
  return points.subarray(0, filled);
}
