// @ts-check
/**
 * Taps by additional fingers, for example on a button while one finger holds a stick.
 *
 * Browsers create clicks only for the first finger on the screen. This module creates them for
 * other fingers, so that speed steps, views and alarms react during driving.
 */

const PRESSED = "button, a[href], summary, label";
/** Time for which the browser's own click for the same tap is ignored, if there is one. */
const SAME_MS = 500;

export function tapWithAnyFinger() {
  /** Element under each pointer at the start of its touch. @type {Map<number, Element>} */
  const down = new Map();
  /** @type {Element | null} */
  let clicked = null;
  let clickedMs = -Infinity;

  const watch = { capture: true, passive: true };
  addEventListener("pointerdown", (event) => {
    if (event.pointerType !== "touch" || event.isPrimary || !(event.target instanceof Element)) return;
    const el = event.target.closest(PRESSED);
    if (el) down.set(event.pointerId, el);
  }, watch);
  addEventListener("touchstart", ({ defaultPrevented, target }) => {
    if (!defaultPrevented || !(target instanceof Node)) return;
    // Held controls ignore clicks, from every finger.
    for (const [id, el] of down) if (el.contains(target)) down.delete(id);
  }, { passive: true });
  addEventListener("pointercancel", (event) => down.delete(event.pointerId), watch);
  addEventListener("pointerup", (event) => {
    const el = down.get(event.pointerId);
    down.delete(event.pointerId);
    const { clientX, clientY } = event;
    if (!el?.contains(document.elementFromPoint(clientX, clientY))) return; // the finger slid off
    const { pointerId, pointerType } = event;
    const click = { bubbles: true, cancelable: true, composed: true, clientX, clientY, pointerId, pointerType };
    el.dispatchEvent(new PointerEvent("click", click));
    clicked = el;
    clickedMs = performance.now();
  }, watch);
  addEventListener("click", (event) => {
    const isSame = event.isTrusted && performance.now() - clickedMs < SAME_MS;
    if (!isSame || !(event.target instanceof Node) || !clicked?.contains(event.target)) return;
    event.preventDefault();
    event.stopImmediatePropagation();
  }, { capture: true });
}
