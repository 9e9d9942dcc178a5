// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").HoldState} HoldState */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { attribute, part, t, write } from "urc/kit";

const WORDS = { idle: t("hold"), asking: "…", held: t("moving"), spent: t("let go") };

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, hold }) {
    if (!el.querySelector(".hold-button-main")) return {}; // no command is bound
    const root = part(el, ".hold-button");
    const main = part(el, ".hold-button-main");
    const word = part(el, ".hold-button-word");
    const note = part(el, ".hold-button-note");
    const level = Number(options["level"] ?? 1);
    let locked = t("not ready yet");
    let notice = "";
    /** @type {HoldState} */
    let state = { phase: "idle", reason: "", values: null };

    function draw() {
      const isHeld = state.values !== null;
      const isLocked = locked !== "" && state.phase === "idle";
      attribute(root, "data-phase", isLocked ? "locked" : state.phase);
      attribute(main, "aria-pressed", String(isHeld && state.phase === "held"));
      write(word, state.phase === "spent" && !isHeld ? WORDS.idle : WORDS[state.phase]);
      const ended = state.phase !== "idle" && state.reason ? `◆ ${state.reason}` : "";
      const why = isLocked ? locked : notice;
      write(note, ended || (why ? `◆ ${why}` : ""));
    }

    hold("held", {
      el: main,
      keys: ["Space", "Enter"],
      sample: () => ({ level }),
      show(now) {
        state = now;
        draw();
      },
    });
    return {
      update(_, { held }) {
        locked = held?.reason ?? t("no command is bound to this button");
        notice = held?.notice ?? "";
        draw();
      },
    };
  },
};
