// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { Setpoint, SetpointView } from "urc/command_kit";
import { attribute, drawing } from "urc/kit";
import { Pull, arc, ray, shareAt } from "./dial.js";

/** Middle of the drawing in its box of 100 by 90, and radius of the rail. */
const MIDDLE = { x: 0.5, y: 50 / 90 };
const RADIUS = 42;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ ...ctx }) {
    const { el, signal } = ctx;
    const face = new SetpointView(el, "knob");
    const dial = el.querySelector(".knob-dial");
    const setpoint = new Setpoint(ctx, show);
    let pull = new Pull(0);

    function show() {
      face.show(setpoint);
      if (!(dial instanceof HTMLElement)) return;
      face.showOn(dial, setpoint);
      const at = setpoint.shareOf(setpoint.shown);
      attribute(drawing(dial, ".knob-level"), "d", at === null || at === 0 ? "" : arc(RADIUS, 0, at));
      attribute(drawing(dial, ".knob-hand"), "d", at === null ? "" : ray(22, 36, at));
      const wished = setpoint.wishState && !setpoint.isOptimistic ? setpoint.shareOf(Number(setpoint.wish.value)) : null;
      attribute(drawing(dial, ".knob-ghost"), "d", wished === null ? "" : ray(36, 48, wished));
    }

    /**
     * @param {PointerEvent} event
     * @returns {[number, number]} distance from the middle, in radii
     */
    function placeOf({ clientX, clientY }) {
      const box = drawing(el, ".knob-drawing").getBoundingClientRect();
      // The drawing keeps its aspect ratio in any box.
      const scale = Math.min(box.width / 100, box.height / 90);
      const [left, top] = [box.left + (box.width - 100 * scale) / 2, box.top + (box.height - 90 * scale) / 2];
      const x = clientX - left - 100 * scale * MIDDLE.x;
      const y = clientY - top - 90 * scale * MIDDLE.y;
      return [x / (RADIUS * scale), y / (RADIUS * scale)];
    }

    if (dial instanceof HTMLElement) {
      attribute(drawing(dial, ".knob-rail"), "d", arc(RADIUS, 0, 1));
      const at = (/** @type {PointerEvent} */ event, /** @type {boolean} */ isNew) => {
        const place = placeOf(event);
        if (isNew) pull = new Pull(shareAt(...place) ?? setpoint.shareOf(setpoint.from) ?? 0);
        return setpoint.at(pull.to(...place));
      };
      face.listen(dial, setpoint, at, "round", signal);
    }
    return {
      update({ state }, { change }) {
        setpoint.take(state, change);
      },
    };
  },
};
