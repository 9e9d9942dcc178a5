// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */
import { Setpoint } from "urc/giving";
import { attribute, part, style, write } from "urc/kit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ ...ctx }) {
    const { el, options, signal } = ctx;
    const root = part(el, ".slider");
    const text = part(el, ".slider-text");
    const note = part(el, ".slider-note");
    const track = el.querySelector(".slider-track");
    const isVertical = options["direction"] === "vertical";
    const setpoint = new Setpoint(ctx, show);
    let pointerId = -1;

    function show() {
      const value = setpoint.shown;
      attribute(root, "data-state", setpoint.state?.state ?? "none");
      attribute(root, "data-alarm", setpoint.state?.alarm ?? "");
      attribute(root, "data-phase", setpoint.giver.phase);
      attribute(root, "data-wish", setpoint.wishState);
      write(text, setpoint.text(value));
      write(note, setpoint.note());
      if (!(track instanceof HTMLElement)) return;
      const isLocked = String(!setpoint.giver.isReady);
      for (const part of root.querySelectorAll("[aria-disabled]")) attribute(part, "aria-disabled", isLocked);
      attribute(track, "aria-valuenow", String(value ?? setpoint.bounds.min));
      attribute(track, "aria-valuetext", setpoint.text(value));
      place(part(track, ".slider-thumb"), setpoint.shareOf(value));
      const wished = setpoint.wishState && !setpoint.isOptimistic ? Number(setpoint.wish.value) : null;
      place(part(track, ".slider-ghost"), setpoint.shareOf(wished));
    }

    /** @param {PointerEvent} event */
    function valueAt({ clientX, clientY }) {
      const box = /** @type {HTMLElement} */ (track).getBoundingClientRect();
      const share = isVertical ? (box.bottom - clientY) / box.height : (clientX - box.left) / box.width;
      return setpoint.at(Math.min(1, Math.max(0, share)));
    }

    if (track instanceof HTMLElement) {
      const { min, max } = setpoint.bounds;
      attribute(track, "aria-valuemin", String(min));
      attribute(track, "aria-valuemax", String(max));
      write(part(root, ".slider-least"), setpoint.text(min));
      write(part(root, ".slider-most"), setpoint.text(max));
      track.addEventListener("pointerdown", (event) => {
        if (event.button !== 0 || pointerId !== -1 || !setpoint.giver.isReady) return;
        event.preventDefault();
        track.focus();
        pointerId = event.pointerId;
        track.setPointerCapture(pointerId);
        setpoint.move(valueAt(event));
      }, { signal });
      track.addEventListener("pointermove", (event) => {
        if (event.pointerId === pointerId) setpoint.move(valueAt(event));
      }, { signal });
      track.addEventListener("pointerup", (event) => {
        if (event.pointerId !== pointerId) return;
        pointerId = -1;
        setpoint.release();
      }, { signal });
      for (const name of ["pointercancel", "lostpointercapture"]) {
        track.addEventListener(name, () => {
          if (pointerId === -1) return;
          pointerId = -1;
          setpoint.cancel();
        }, { signal });
      }
      track.addEventListener("keydown", (event) => {
        if (setpoint.key(event.key)) event.preventDefault();
      }, { signal });
      part(root, ".slider-less").addEventListener("click", () => setpoint.key("ArrowLeft"), { signal });
      part(root, ".slider-more").addEventListener("click", () => setpoint.key("ArrowRight"), { signal });
    }
    return {
      update({ state }, { change }) {
        setpoint.take(state, change);
      },
    };
  },
};

/**
 * @param {HTMLElement} el
 * @param {number | null} share
 */
function place(el, share) {
  if (el.hidden !== (share === null)) el.hidden = share === null;
  if (share !== null) style(el, "--slider-share", share.toFixed(4));
}
