// @ts-check
/**
 * Pointer capture: one pointer holds an element until its release or loss.
 *
 * Controls that move a robot use `ctx.hold` instead, which also stops the robot.
 *
 * @typedef {object} Grasp
 * @property {() => void} drop ends a hold, if there is one
 *
 * @typedef {"x" | "y" | "round"} Way drag direction: along an axis, or around a dial
 */

/** Events that make a drag invalid. */
const BREAKS = ["blur", "pagehide", "resize", "urc-let-go"];
/** Distance below which a touch is not yet a drag. */
const STILL_PX = 6;
/** Time after which a resting finger on a dial counts as a drag, regardless of its next move. */
const REST_MS = 400;

/**
 * Whether a finger, a pen or the main button of a mouse is down. While a second mouse button is down
 * too, the release of the first one is only reported as a move.
 *
 * @param {PointerEvent} event
 */
export function isDown({ buttons }) {
  return (buttons & 1) !== 0;
}

/**
 * Whether a touch is a drag and not a scroll of the page; null while undecided.
 *
 * @param {Way} way
 * @param {PointerEvent} from start of the touch
 * @param {PointerEvent} to
 * @returns {boolean | null}
 */
export function draws(way, from, to) {
  const across = Math.abs(to.clientX - from.clientX);
  const along = Math.abs(to.clientY - from.clientY);
  if (Math.max(across, along) < STILL_PX) return null;
  if (way === "y") return along > across;
  return across > along || (way === "round" && to.timeStamp - from.timeStamp >= REST_MS);
}

/**
 * Allow one pointer at a time to hold an element.
 *
 * @param {HTMLElement} el
 * @param {object} spec
 * @param {(event: PointerEvent) => boolean} spec.take handles a press; returns whether the hold begins
 * @param {(event: PointerEvent) => void} spec.move
 * @param {(event: PointerEvent) => void} spec.release handles a release by the operator
 * @param {() => void} spec.cancel handles the loss of the pointer
 * @param {boolean} [spec.isDrawing] whether loss of focus or a resize of the page cancels, and a touch
 *   opens no menu and no zoom
 * @param {Way} [spec.way] drag direction, if other touches may scroll the page: a hold begins with a
 *   drag or a tap. The style `touch-action` of the element says where it scrolls
 * @param {AbortSignal} spec.signal
 * @returns {Grasp}
 */
export function grasp(el, { take, move, release, cancel, isDrawing = false, way, signal }) {
  let pointerId = -1;
  let finger = /** @type {PointerEvent | null} */ (null); // a touch that may become a scroll
  const drop = () => {
    finger = null;
    if (pointerId === -1) return;
    pointerId = -1;
    cancel();
  };
  const hold = (/** @type {PointerEvent} */ event) => {
    finger = null;
    if (!take(event)) return;
    pointerId = event.pointerId;
    el.setPointerCapture(pointerId);
  };
  const letGo = (/** @type {PointerEvent} */ event) => {
    if (event.pointerId === finger?.pointerId) hold(event); // a tap
    if (event.pointerId !== pointerId) return;
    pointerId = -1; // first, so that the subsequent loss of capture cancels nothing
    release(event);
  };
  el.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || pointerId !== -1 || finger) return;
    if (way && event.pointerType === "touch") finger = event;
    else hold(event);
  }, { signal });
  el.addEventListener("pointermove", (event) => {
    const isMeant = way && event.pointerId === finger?.pointerId ? draws(way, finger, event) : null;
    if (isMeant) hold(event);
    else if (isMeant === false) finger = null;
    else if (event.pointerId === pointerId) (isDown(event) ? move : letGo)(event);
  }, { signal });
  el.addEventListener("pointerup", letGo, { signal });
  el.addEventListener("pointercancel", drop, { signal });
  // Child elements lose an implicit capture to the whole element.
  el.addEventListener("lostpointercapture", ({ target }) => target === el && drop(), { signal });
  if (isDrawing) for (const name of BREAKS) addEventListener(name, drop, { signal });
  if (isDrawing || way) keepStill(el, () => isDrawing || pointerId !== -1, signal);
  return { drop };
}

/**
 * Disable scroll, zoom and menu for touches on an element.
 *
 * @param {HTMLElement} el
 * @param {() => boolean} isSo
 * @param {AbortSignal} signal
 */
function keepStill(el, isSo, signal) {
  for (const name of ["touchstart", "touchmove"]) {
    el.addEventListener(name, (event) => isSo() && event.preventDefault(), { signal, passive: false });
  }
}
