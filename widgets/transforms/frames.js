// @ts-check
/**
 * Rows of a transform tree. Pure.
 *
 * @typedef {object} Frame One frame of the tree, from the server.
 * @property {string} name
 * @property {string} parent "" for a root.
 * @property {number} depth Number of transforms to the root.
 * @property {number | null} age Age of the transform in seconds; null for a static one or a root.
 * @property {readonly number[]} translation x, y and z in metres; empty for a root.
 * @property {readonly number[]} rotation Quaternion as x, y, z, w; empty for a root.
 * @property {string} rival Second parent, reported in turn with the parent; "" without one.
 */

/** Maximum number of rows; the server sends no more frames. */
const MOST = 501;
/** Degree of indentation beyond which rows are no longer moved. */
const DEEPEST = 12;
const DEGREES = 180 / Math.PI;

/**
 * Return the frames in a value of the type transform_tree, parents before their children.
 *
 * @param {unknown} value
 * @returns {Frame[]}
 */
export function framesOf(value) {
  const rows = typeof value === "object" && value !== null ? Reflect.get(value, "frames") : null;
  return Array.isArray(rows) ? rows.slice(0, MOST).map(frameOf) : [];
}

/**
 * @param {any} row
 * @returns {Frame}
 */
function frameOf(row) {
  return {
    name: text(row?.name),
    parent: text(row?.parent),
    depth: Math.min(DEEPEST, Math.max(0, Number(row?.depth) || 0)),
    age: typeof row?.age === "number" ? row.age : null,
    translation: numbers(row?.translation, 3),
    rotation: numbers(row?.rotation, 4),
    rival: text(row?.other_parent),
  };
}

/** @param {unknown} value */
function text(value) {
  return typeof value === "string" ? value : "";
}

/**
 * @param {unknown} value
 * @param {number} count
 * @returns {readonly number[]}
 */
function numbers(value, count) {
  const isGood = Array.isArray(value) && value.length === count && value.every((one) => typeof one === "number");
  return isGood ? value : [];
}

/**
 * Return a transform for people: the position in metres, and the yaw in degrees.
 *
 * @param {Frame} frame
 */
export function placeOf({ translation, rotation }) {
  const [qx = 0, qy = 0, qz = 0, qw = 1] = rotation;
  if (translation.length === 0) return "";
  const place = translation.map((one) => decimal(one, 2)).join(" ");
  const yaw = Math.atan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz) * DEGREES;
  return `${place} m · ${decimal(yaw, 0)}°`;
}

/**
 * @param {number} value
 * @param {number} digits
 */
function decimal(value, digits) {
  const written = value.toFixed(digits);
  return Number(written) === 0 ? (0).toFixed(digits) : written.replace("-", "−");
}

/**
 * Return the frames whose own name, or parent's name, contains the text.
 *
 * @param {readonly Frame[]} frames
 * @param {string} filter
 */
export function filtered(frames, filter) {
  const needle = filter.trim().toLowerCase();
  if (!needle) return frames;
  return frames.filter(({ name, parent }) => `${name} ${parent}`.toLowerCase().includes(needle));
}
