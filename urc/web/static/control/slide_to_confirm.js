// @ts-check
/** A slide to confirm, against accidental touches. */
import { grasp } from "./pointer_capture.js";

/** Time after which a resting finger counts as a slide, for operators who cannot drag. */
const REST_MS = 1500;
const REST_EVERY_MS = 50;
/** Distance below which a finger counts as resting. */
const STILL_PX = 8;
/** Share of the slide's width for a complete slide. */
const WAY = 0.75;

/**
 * Make an element a slide. It acts after a drag to its end and a release, after a long press, or
 * after ten separate presses of an arrow key.
 *
 * @param {HTMLElement} el empty
 * @param {object} spec
 * @param {string} spec.label description of the action
 * @param {() => void} spec.done
 * @param {() => void} [spec.touched] called at the start of a slide
 * @param {() => boolean} [spec.isReady]
 * @param {import("../core/types.js").Context["onStop"]} [spec.onStop] reports STOP, which cancels a
 *   slide
 * @param {AbortSignal} spec.signal
 */
export function slide(el, { label, done, touched, isReady = () => true, onStop, signal }) {
  const fill = document.createElement("span");
  fill.className = "urc-slide-fill";
  const knob = document.createElement("span");
  knob.className = "urc-slide-knob";
  knob.setAttribute("aria-hidden", "true");
  knob.textContent = "»";
  const text = document.createElement("span");
  text.className = "urc-slide-text";
  text.textContent = label;
  el.classList.add("urc-slide");
  el.append(fill, text, knob);
  el.tabIndex = 0;
  el.setAttribute("role", "slider");
  el.setAttribute("aria-label", label);
  el.setAttribute("aria-valuemin", "0");
  el.setAttribute("aria-valuemax", "100");
  let share = 0;
  let startX = 0;
  let farPx = 0;
  /** @type {number | undefined} */
  let resting;

  /** @param {number} now position, 0 to 1 */
  function put(now) {
    share = Math.min(1, Math.max(0, now));
    el.style.setProperty("--urc-slide", String(share));
    el.setAttribute("aria-valuenow", String(Math.round(100 * share)));
  }
  function letGo() {
    const isDone = share >= 1;
    clearInterval(resting);
    put(0);
    if (isDone && isReady()) done();
  }
  function forget() {
    put(0);
    letGo();
  }
  const hold = grasp(el, {
    take(event) {
      if (!isReady()) return false;
      event.preventDefault();
      el.focus();
      touched?.();
      startX = event.clientX;
      farPx = 0;
      const width = el.clientWidth || 1;
      el.dataset["way"] = String(width * WAY);
      resting = window.setInterval(() => {
        if (farPx < STILL_PX) put(share + REST_EVERY_MS / REST_MS);
      }, REST_EVERY_MS);
      return true;
    },
    move(event) {
      const way = event.clientX - startX;
      farPx = Math.max(farPx, Math.abs(way));
      if (farPx >= STILL_PX) put(way / Number(el.dataset["way"]));
    },
    release: letGo,
    cancel: forget,
    signal,
  });
  el.addEventListener("keydown", (event) => {
    const way = { ArrowRight: 0.1, ArrowUp: 0.1, ArrowLeft: -0.1, ArrowDown: -0.1 }[event.key];
    if (way === undefined || !isReady()) return;
    event.preventDefault();
    if (event.repeat) return; // a key that something presses down would confirm by itself
    touched?.();
    hold.drop(); // one input at a time
    put(Math.round((share + way) * 10) / 10);
    if (share >= 1) letGo();
  }, { signal });
  el.addEventListener("blur", () => {
    hold.drop();
    forget();
  }, { signal });
  onStop?.(({ phase }) => {
    if (phase === "") return;
    hold.drop();
    forget();
  });
  signal.addEventListener("abort", () => clearInterval(resting));
  put(0);
}
