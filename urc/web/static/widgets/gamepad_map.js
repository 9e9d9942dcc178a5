// @ts-check
/**
 * The mapping of a gamepad's sticks and buttons: the browser's standard, or the operator's mapping
 * for the device. Pure.
 *
 * @typedef {"left" | "right"} Side
 *
 * @typedef {object} PadMap
 * @property {number[]} axes Indexes of left across, left along, right across, right along; -1 for none.
 * @property {boolean[]} turned Whether each axis is inverted.
 * @property {number[]} left Buttons that enable the left stick while one is held.
 * @property {number[]} right The same for the right stick.
 * @property {number} slower Button for the next lower speed step; -1 for none.
 * @property {number} faster Button for the next higher speed step; -1 for none.
 */

const MOST = 64;
const AXES = 4;

/** The layout that browsers call "standard". @type {Readonly<PadMap>} */
export const STANDARD = Object.freeze({
  axes: [0, 1, 2, 3],
  turned: [false, false, false, false],
  left: [4, 6],
  right: [5, 7],
  slower: 13,
  faster: 12,
});

/**
 * Return a stored mapping; null if it is invalid, because stored text cannot be trusted.
 *
 * @param {string | null} text
 * @returns {PadMap | null}
 */
export function parsed(text) {
  try {
    const { axes, turned, left, right, slower, faster } = JSON.parse(text ?? "");
    const isPlaces = (/** @type {unknown} */ list, least = 0) =>
      Array.isArray(list) && list.length <= MOST && list.every((one) => isPlace(one, least));
    const isGood =
      isPlaces(axes, -1) && axes.length === AXES && isPlaces(left) && isPlaces(right) &&
      Array.isArray(turned) && turned.length === AXES &&
      turned.every((one) => typeof one === "boolean") &&
      isPlace(slower, -1) && isPlace(faster, -1);
    return isGood ? { axes, turned, left, right, slower, faster } : null;
  } catch {
    return null;
  }
}

/**
 * @param {unknown} value
 * @param {number} least
 */
function isPlace(value, least) {
  return Number.isInteger(value) && Number(value) >= least && Number(value) < MOST;
}

/**
 * Return left across, left along, right across and right along; right and down are positive.
 *
 * @param {PadMap} map
 * @param {readonly number[]} axes
 * @returns {[number, number, number, number]}
 */
export function sticksOf(map, axes) {
  const one = (/** @type {number} */ which) => {
    const value = axes[map.axes[which] ?? -1] ?? 0;
    return Number.isFinite(value) ? (map.turned[which] ? -value : value) + 0 : 0;
  };
  return [one(0), one(1), one(2), one(3)];
}

/**
 * Return the mapping with one button changed.
 *
 * @param {PadMap} map
 * @param {"left" | "right" | "slower" | "faster"} name
 * @param {number} button
 * @returns {PadMap}
 */
export function withButton(map, name, button) {
  return { ...map, [name]: name === "left" || name === "right" ? [button] : button };
}

/**
 * @param {PadMap} map
 * @param {number} which 0 to 3
 * @param {number} place
 * @param {boolean} isTurned
 * @returns {PadMap}
 */
export function withAxis(map, which, place, isTurned) {
  const at = (/** @type {number} */ index) => index === which;
  return {
    ...map,
    axes: map.axes.map((old, index) => (at(index) ? place : old)),
    turned: map.turned.map((old, index) => (at(index) ? isTurned : old)),
  };
}

/**
 * Return the axis with the largest change from its rest position, with its direction; null without a
 * large change.
 *
 * @param {readonly number[]} rest
 * @param {readonly number[]} now
 * @returns {{place: number, isNegative: boolean} | null}
 */
export function movedAxis(rest, now) {
  let found = null;
  let far = 0.5;
  now.forEach((value, place) => {
    const way = value - (rest[place] ?? 0);
    if (Math.abs(way) > far) {
      far = Math.abs(way);
      found = { place, isNegative: way < 0 };
    }
  });
  return found;
}
