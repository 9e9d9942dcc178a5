// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */
import { Setpoint } from "urc/giving";
import { attribute, drawing, part, write } from "urc/kit";
import { arc, ray, sharePulled, shareAt } from "./dial.js";

/** The middle of the drawing in its box of 100 by 90, and the radius of the rail. */
const MIDDLE = { x: 0.5, y: 50 / 90 };
const RADIUS = 42;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ ...ctx }) {
    const { el, signal } = ctx;
    const root = part(el, ".knob");
    const text = part(el, ".knob-text");
    const note = part(el, ".knob-note");
    const dial = el.querySelector(".knob-dial");
    const setpoint = new Setpoint(ctx, show);
    let pointerId = -1;
    let share = 0;

    function show() {
      const value = setpoint.shown;
      attribute(root, "data-state", setpoint.state?.state ?? "none");
      attribute(root, "data-alarm", setpoint.state?.alarm ?? "");
      attribute(root, "data-phase", setpoint.giver.phase);
      attribute(root, "data-wish", setpoint.wishState);
      write(text, setpoint.text(value));
      write(note, setpoint.note());
      if (!(dial instanceof HTMLElement)) return;
      const isLocked = String(!setpoint.giver.isReady);
      for (const part of root.querySelectorAll("[aria-disabled]")) attribute(part, "aria-disabled", isLocked);
      attribute(dial, "aria-valuenow", String(value ?? setpoint.bounds.min));
      attribute(dial, "aria-valuetext", setpoint.text(value));
      const at = setpoint.shareOf(value);
      attribute(drawing(dial, ".knob-level"), "d", at === null || at === 0 ? "" : arc(RADIUS, 0, at));
      attribute(drawing(dial, ".knob-hand"), "d", at === null ? "" : ray(22, 36, at));
      const wished = setpoint.wishState && !setpoint.isOptimistic ? setpoint.shareOf(Number(setpoint.wish.value)) : null;
      attribute(drawing(dial, ".knob-ghost"), "d", wished === null ? "" : ray(36, 48, wished));
    }

    /**
     * @param {PointerEvent} event
     * @returns {[number, number]} in radii from the middle
     */
    function placeOf({ clientX, clientY }) {
      const box = drawing(root, ".knob-drawing").getBoundingClientRect();
      // The drawing keeps its shape in a box of any other.
      const scale = Math.min(box.width / 100, box.height / 90);
      const [left, top] = [box.left + (box.width - 100 * scale) / 2, box.top + (box.height - 90 * scale) / 2];
      const x = clientX - left - 100 * scale * MIDDLE.x;
      const y = clientY - top - 90 * scale * MIDDLE.y;
      return [x / (RADIUS * scale), y / (RADIUS * scale)];
    }

    if (dial instanceof HTMLElement) {
      attribute(drawing(dial, ".knob-rail"), "d", arc(RADIUS, 0, 1));
      attribute(dial, "aria-valuemin", String(setpoint.bounds.min));
      attribute(dial, "aria-valuemax", String(setpoint.bounds.max));
      dial.addEventListener("pointerdown", (event) => {
        if (event.button !== 0 || pointerId !== -1 || !setpoint.giver.isReady) return;
        event.preventDefault();
        dial.focus();
        pointerId = event.pointerId;
        dial.setPointerCapture(pointerId);
        share = shareAt(...placeOf(event)) ?? setpoint.shareOf(setpoint.from) ?? 0;
        setpoint.move(setpoint.at(share));
      }, { signal });
      dial.addEventListener("pointermove", (event) => {
        if (event.pointerId !== pointerId) return;
        share = sharePulled(...placeOf(event), share);
        setpoint.move(setpoint.at(share));
      }, { signal });
      dial.addEventListener("pointerup", (event) => {
        if (event.pointerId !== pointerId) return;
        pointerId = -1;
        setpoint.release();
      }, { signal });
      for (const name of ["pointercancel", "lostpointercapture"]) {
        dial.addEventListener(name, () => {
          if (pointerId === -1) return;
          pointerId = -1;
          setpoint.cancel();
        }, { signal });
      }
      dial.addEventListener("keydown", (event) => {
        if (setpoint.key(event.key)) event.preventDefault();
      }, { signal });
      part(root, ".knob-less").addEventListener("click", () => setpoint.key("ArrowLeft"), { signal });
      part(root, ".knob-more").addEventListener("click", () => setpoint.key("ArrowRight"), { signal });
    }
    return {
      update({ state }, { change }) {
        setpoint.take(state, change);
      },
    };
  },
};
