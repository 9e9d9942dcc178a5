// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { Setpoint, SetpointView } from "urc/command_kit";
import { part, style, write } from "urc/kit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ ...ctx }) {
    const { el, options, signal } = ctx;
    const face = new SetpointView(el, "slider");
    const track = el.querySelector(".slider-track");
    const isVertical = options["direction"] === "vertical";
    const setpoint = new Setpoint(ctx, show);

    function show() {
      face.show(setpoint);
      if (!(track instanceof HTMLElement)) return;
      face.showOn(track, setpoint);
      place(part(track, ".slider-thumb"), setpoint.shareOf(setpoint.shown));
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
      write(part(el, ".slider-least"), setpoint.text(min));
      write(part(el, ".slider-most"), setpoint.text(max));
      face.listen(track, setpoint, valueAt, isVertical ? "y" : "x", signal);
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
