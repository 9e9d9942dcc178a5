// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Hand} Hand */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { attribute, part, write } from "urc/kit";
import { DIRECTIONS, Motion, pointed, signed } from "urc/motion";

/** Drawn key → keys with the same meaning, by position. @type {Record<string, readonly string[]>} */
const CAPS = {
  KeyW: DIRECTIONS.ahead,
  KeyS: DIRECTIONS.back,
  KeyA: DIRECTIONS.left,
  KeyD: DIRECTIONS.right,
  KeyQ: ["KeyQ"],
  KeyE: ["KeyE"],
};

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, signal } = ctx;
    if (!el.querySelector(".keyboard-keys")) return {}; // no command is bound
    const field = part(el, ".keyboard-keys");
    const everywhere = part(el, ".keyboard-on");
    const [x, y, turn] = ["x", "y", "turn"].map((name) => part(el, `.keyboard-${name}`));
    const caps = [...el.querySelectorAll("[data-code]")];
    const level = Number(options["level"] ?? 1);
    let isEverywhere = options["everywhere"] === true;
    /** @type {ReadonlySet<string>} */
    let down = new Set();

    const motion = new Motion(ctx, "keyboard", "moved");
    motion.hold({
      el: field,
      keys: Object.values(CAPS).flat(),
      page: () => (isEverywhere ? "free" : "none"),
      isFree: () => false, // a touch on the picture holds no control
      push({ keys }) {
        down = keys;
        const { x: ahead, y: left } = pointed(keys);
        const turned = Number(keys.has("KeyQ")) - Number(keys.has("KeyE"));
        return { push: { x: ahead * level, y: left * level, turn: turned * level }, isFine: false };
      },
      draw({ phase, push, values }) {
        for (const cap of caps) {
          const codes = CAPS[cap.getAttribute("data-code") ?? ""] ?? [];
          const isDown = push !== null && phase === "held" && codes.some((code) => down.has(code));
          attribute(cap, "data-down", isDown ? "" : null);
        }
        if (x) write(x, signed(values["x"]));
        if (y) write(y, signed(values["y"]));
        if (turn) write(turn, signed(values["turn"]));
      },
    });

    const show = () => attribute(everywhere, "aria-pressed", String(isEverywhere));
    everywhere.addEventListener(
      "click",
      () => {
        isEverywhere = !isEverywhere;
        show();
      },
      { signal },
    );
    show();
    return motion.instance();
  },
};
