// @ts-check
/**
 * One pointer that has hold of an element, until it is let go or taken away.
 *
 * Not for what moves a robot while it is held: that is `ctx.hold`, which lets go by itself.
 *
 * @typedef {object} Grasp
 * @property {() => void} drop takes it away, where somebody has hold of it
 *
 * @typedef {"x" | "y" | "round"} Way how a finger draws something: along an axis, or round a dial
 */

/** After these, what a hand has drawn so far is not what it meant. */
const BREAKS = ["blur", "pagehide", "resize", "urc-let-go"];
/** A finger that has gone less far has not begun to draw. */
const STILL_PX = 6;
/** A finger that has rested for so long on a dial means the dial, wherever it goes then. */
const REST_MS = 400;

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
 * Whether a finger draws, and does not scroll the page; null while nobody can tell.
 *
 * @param {Way} way
 * @param {PointerEvent} from where it went down
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
 * @param {Way} [spec.way] where a finger may scroll the page by any other way: it takes hold when it
 *   draws, or by a tap, and not before. The style of the element says where it scrolls: `touch-action`
 * @param {AbortSignal} spec.signal
 * @returns {Grasp}
 */
export function grasp(el, { take, move, release, cancel, isDrawing = false, way, signal }) {
  let pointerId = -1;
  let finger = /** @type {PointerEvent | null} */ (null); // one that may yet want something else
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
    pointerId = -1; // so that losing the capture, which follows, cancels nothing
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
  // A part of it that a finger touched loses what it had to the whole.
  el.addEventListener("lostpointercapture", ({ target }) => target === el && drop(), { signal });
  if (isDrawing) for (const name of BREAKS) addEventListener(name, drop, { signal });
  if (isDrawing || way) keepStill(el, () => isDrawing || pointerId !== -1, signal);
  return { drop };
}

/**
 * Have a touch on an element scroll, zoom and open nothing.
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
