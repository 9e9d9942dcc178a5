// @ts-check
/**
 * One pointer that has hold of an element, until it is let go or taken away.
 *
 * Not for what moves a robot while it is held: that is `ctx.hold`, which lets go by itself.
 *
 * @typedef {object} Grasp
 * @property {() => void} drop takes it away, where somebody has hold of it
 */

/** After these, what a hand has drawn so far is not what it meant. */
const BREAKS = ["blur", "pagehide", "resize", "urc-let-go"];

/**
 * Whether a finger, a pen or the main button of a mouse is down. With another button of the mouse down
 * as well, a move that says so is all that is told of the first one's end.
 *
 * @param {PointerEvent} event
 */
export function isDown({ buttons }) {
  return (buttons & 1) !== 0;
}

/**
 * Let one pointer at a time take hold of an element.
 *
 * @param {HTMLElement} el
 * @param {object} spec
 * @param {(event: PointerEvent) => boolean} spec.take one goes down; whether it takes hold
 * @param {(event: PointerEvent) => void} spec.move
 * @param {(event: PointerEvent) => void} spec.release somebody has let it go
 * @param {() => void} spec.cancel it was taken away
 * @param {boolean} [spec.isDrawing] whether it is lost with the page's focus or size, and a touch
 *   begins nothing else, no menu and no zoom
 * @param {AbortSignal} spec.signal
 * @returns {Grasp}
 */
export function grasp(el, { take, move, release, cancel, isDrawing = false, signal }) {
  let pointerId = -1;
  const drop = () => {
    if (pointerId === -1) return;
    pointerId = -1;
    cancel();
  };
  el.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || pointerId !== -1 || !take(event)) return;
    pointerId = event.pointerId;
    el.setPointerCapture(pointerId);
  }, { signal });
  const letGo = (/** @type {PointerEvent} */ event) => {
    if (event.pointerId !== pointerId) return;
    pointerId = -1; // so that losing the capture, which follows, cancels nothing
    release(event);
  };
  el.addEventListener("pointermove", (event) => {
    if (event.pointerId !== pointerId) return;
    if (isDown(event)) move(event);
    else letGo(event);
  }, { signal });
  el.addEventListener("pointerup", letGo, { signal });
  for (const name of ["pointercancel", "lostpointercapture"]) el.addEventListener(name, drop, { signal });
  if (isDrawing) {
    for (const name of BREAKS) addEventListener(name, drop, { signal });
    el.addEventListener("touchstart", (event) => event.preventDefault(), { signal, passive: false });
  }
  return { drop };
}
