// @ts-check
/**
 * A press that counts when it is touched, not when it is let go: STOP waits for no finger.
 */

/**
 * Call `act` when an element is touched. A key and a screen reader have only the click; the click that
 * follows a touch is the same press, and one that slid off has none.
 *
 * @param {HTMLElement} el
 * @param {() => void} act
 * @param {AbortSignal} [signal]
 */
export function whenPressed(el, act, signal) {
  const options = signal ? { signal } : {};
  /** The pointer whose touch has counted. */
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
