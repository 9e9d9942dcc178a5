// @ts-check
/**
 * What a hand feels: a tick when it has taken hold, another at the end of the way, two when nothing
 * comes of it. Only where the device can; never the only sign.
 */

const TICK_MS = 12;
const LIMIT_MS = 25;
const REFUSED_MS = [30, 60, 30];
const CALM = "(prefers-reduced-motion: reduce)";

/**
 * @typedef {object} Feeling
 * @property {boolean} isHeld
 * @property {boolean} isSpent
 * @property {boolean} isAtEnd
 */

/** What each control felt like last. @type {WeakMap<object, Feeling>} */
const last = new WeakMap();

/**
 * Tell how a control is now; the hand feels what has changed.
 *
 * @param {object} control the same one each time
 * @param {boolean} isHeld
 * @param {boolean} isSpent
 * @param {Readonly<Record<string, unknown>> | null} values from -1 to 1
 */
export function feel(control, isHeld, isSpent, values) {
  const isAtEnd = isHeld && Object.values(values ?? {}).some((one) => Math.abs(Number(one)) >= 1);
  const before = last.get(control);
  last.set(control, { isHeld, isSpent, isAtEnd });
  if (!isHeld) return;
  if (isSpent) {
    if (!before?.isHeld || !before.isSpent) buzz(REFUSED_MS);
  } else if (!before?.isHeld) {
    buzz(TICK_MS);
  } else if (isAtEnd && !before.isAtEnd) {
    buzz(LIMIT_MS);
  }
}

/** @param {number | number[]} pattern */
function buzz(pattern) {
  // Before the first touch a browser refuses, and complains.
  if (!("vibrate" in navigator) || !navigator.userActivation?.hasBeenActive) return;
  if (matchMedia(CALM).matches) return;
  navigator.vibrate(pattern);
}
