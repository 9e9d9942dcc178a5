// @ts-check
/**
 * Gestures on a button: double tap, long press, repeat. A click without a pointer, from a screen reader
 * or a key, counts as the whole gesture if time cannot distinguish the gesture.
 */

import { isDown } from "urc/command_kit";

/** Duration of a long press. */
export const HOLD_MS = 800;
/** Longest time between the taps of a double tap. */
export const DOUBLE_MS = 500;
const EVERY_MS = 40;
/** Time after which a touch is a press instead of the start of a scroll. */
const SETTLE_MS = 100;

/**
 * @param {HTMLElement} el
 * @param {object} spec
 * @param {"tap" | "double" | "hold" | "repeat"} spec.gesture
 * @param {number} spec.repeatMs
 * @param {() => boolean} spec.isReady
 * @param {() => void} spec.done
 * @param {(share: number) => void} spec.progress reports the progress of a long press, 0 to 1
 * @param {AbortSignal} spec.signal
 * @returns {() => void} cancels the present gesture
 */
export function listen(el, { gesture, repeatMs, isReady, done, progress, signal }) {
  let firstMs = -Infinity;
  let downMs = -1;
  /** @type {number | undefined} */
  let timer;
  /** Timer of a touch that may become a scroll. @type {number | undefined} */
  let settling;
  if (gesture === "tap" || gesture === "double") {
    el.addEventListener("click", () => {
      const nowMs = performance.now();
      const isSecond = nowMs - firstMs < DOUBLE_MS;
      firstMs = isSecond ? -Infinity : nowMs;
      if (gesture === "tap" || isSecond) done();
    }, { signal });
    el.addEventListener("keydown", (event) => {
      // A held key repeats its clicks; all these clicks count as one tap.
      if (event.repeat && event.key === "Enter") event.preventDefault();
    }, { signal });
    return () => (firstMs = -Infinity);
  }

  function end() {
    clearTimeout(settling);
    settling = undefined;
    clearInterval(timer);
    downMs = -1;
    progress(0);
  }
  function begin() {
    clearTimeout(settling);
    settling = undefined;
    if (downMs >= 0 || !isReady()) return;
    downMs = performance.now();
    if (gesture === "repeat") {
      done();
      timer = window.setInterval(() => (isReady() ? done() : end()), repeatMs);
      progress(1);
      return;
    }
    timer = window.setInterval(() => {
      const share = (performance.now() - downMs) / HOLD_MS;
      if (!isReady()) return end();
      if (share < 1) return progress(share);
      end();
      done();
    }, EVERY_MS);
  }
  el.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    el.setPointerCapture(event.pointerId);
    // A long press acts late anyway, and a scroll cancels it.
    if (gesture === "hold" || event.pointerType !== "touch") begin();
    else if (downMs < 0) settling ??= window.setTimeout(begin, SETTLE_MS);
  }, { signal });
  el.addEventListener("pointerup", () => settling !== undefined && begin(), { signal }); // a tap
  el.addEventListener("touchmove", (event) => {
    if (gesture === "repeat" && downMs >= 0) event.preventDefault(); // a press: no scroll
  }, { signal, passive: false });
  for (const name of ["pointerup", "pointercancel", "lostpointercapture", "blur", "keyup"]) {
    el.addEventListener(name, end, { signal });
  }
  el.addEventListener("pointermove", (event) => {
    const box = el.getBoundingClientRect();
    const isInside = event.clientX >= box.left && event.clientX <= box.right
      && event.clientY >= box.top && event.clientY <= box.bottom;
    if (downMs >= 0 && !(isInside && isDown(event))) end();
  }, { signal });
  el.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault(); // no additional click
    if (!event.repeat) begin();
  }, { signal });
  el.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
  addEventListener("blur", end, { signal });
  document.addEventListener("visibilitychange", end, { signal });
  signal.addEventListener("abort", end);
  return end;
}
