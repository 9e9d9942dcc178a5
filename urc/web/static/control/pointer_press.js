// @ts-check
/**
 * A press that acts on touch, not on release, because STOP must not wait until the finger lifts.
 */

/**
 * Call `act` when an element is touched. Keys and screen readers only send a click. The click after a
 * touch is the same press, and is ignored.
 *
 * @param {HTMLElement} el
 * @param {() => void} act
 * @param {AbortSignal} [signal]
 */
export function whenPressed(el, act, signal) {
  const options = signal ? { signal } : {};
  /** The pointer whose touch has already acted. */
  let counted = NaN;
  el.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    counted = event.pointerId;
    act();
  }, options);
  el.addEventListener("click", (event) => {
    const isSame = event instanceof PointerEvent && event.pointerId === counted;
    counted = NaN;
    if (!isSame) act();
  }, options);
}
