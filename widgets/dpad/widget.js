// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Hand} Hand */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { arrow } from "urc/response_curve";
import { attribute, part } from "urc/kit";
import { along, DIRECTIONS, Motion, pointed } from "urc/motion";

/** Fraction around the middle without a direction: the middle of three fields. */
const REST = 1 / 3;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options } = ctx;
    if (!el.querySelector(".dpad-pad")) return {}; // no command is bound
    const pad = part(el, ".dpad-pad");
    const buttons = [...el.querySelectorAll("[data-at]")];
    const level = Number(options["level"] ?? 1);
    const axes = String(options["axes"] ?? "both");
    const isDiagonal = options["diagonals"] !== false && axes === "both";
    let box = pad.getBoundingClientRect();

    /** @param {Hand} hand */
    function where(hand) {
      if (hand.kind === "pad") return arrow(-hand.axes[1], -hand.axes[0], isDiagonal, REST);
      if (hand.kind === "keys") return hand.keys.has("Enter") ? focused(buttons) : pointed(hand.keys);
      const x = (box.top + box.height / 2 - hand.y) / (box.height / 2);
      const y = (box.left + box.width / 2 - hand.x) / (box.width / 2);
      return arrow(axes === "y" ? 0 : x, axes === "x" ? 0 : y, isDiagonal, REST);
    }

    const motion = new Motion(ctx, "dpad", "moved");
    motion.hold({
      el: pad,
      keys: ["Enter", ...Object.values(DIRECTIONS).flat()],
      pad: options["pad"] === "left" || options["pad"] === "right" ? options["pad"] : "",
      push(hand, isNew) {
        if (isNew) box = pad.getBoundingClientRect();
        const { x, y } = where(hand);
        return { push: along(axes, { x: x * level, y: y * level }), isFine: false };
      },
      draw({ push, phase }) {
        const { x = 0, y = 0 } = push ?? {};
        const at = phase === "held" ? `${Math.sign(x) + 0} ${Math.sign(y) + 0}` : "";
        for (const button of buttons) {
          attribute(button, "aria-pressed", String(button.getAttribute("data-at") === at));
        }
      },
    });
    return motion.instance();
  },
};

/**
 * Return the direction of the focused arrow.
 *
 * @param {Element[]} buttons
 */
function focused(buttons) {
  const button = buttons.find((each) => each === document.activeElement);
  const [x = 0, y = 0] = (button?.getAttribute("data-at") ?? "0 0").split(" ").map(Number);
  return { x, y };
}
