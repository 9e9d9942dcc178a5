// @ts-check
/**
 * Haptic feedback: one pulse for the start of a hold, one at the end of the travel, two for a refusal.
 * It is never the only feedback, because many devices do not support vibration.
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

/** Last state of each control. @type {WeakMap<object, Feeling>} */
const last = new WeakMap();

/**
 * Report the state of a control; changes cause haptic feedback.
 *
 * @param {object} control the same object in all calls
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
  // Before the first touch, browsers refuse vibration with a warning.
  if (!("vibrate" in navigator) || !navigator.userActivation?.hasBeenActive) return;
  if (matchMedia(CALM).matches) return;
  navigator.vibrate(pattern);
}
