// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").StopState} StopState */
import { whenPressed } from "urc/command_kit";
import { inTurn } from "urc/kit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, stop, onStop, signal, t }) {
    const root = find(el, ".stop");
    const main = find(el, ".stop-main");
    const note = find(el, ".stop-note");
    /** @param {StopState} state */
    function show(state) {
      const isCut = state.phase === "failed" || (state.fault !== "" && !state.isConfirmed);
      root.setAttribute("data-phase", isCut ? "fault" : state.phase);
      note.textContent = words(state, isCut, t);
    }
    whenPressed(main, stop, signal);
    main.removeAttribute("data-early-stop"); // armed: the page's first script no longer handles the button
    onStop(show);
    return {};
  },
};

/**
 * @param {StopState} state
 * @param {boolean} isCut
 * @param {Context["t"]} t
 */
function words({ phase, isLatched, isConfirmed, fault }, isCut, t) {
  if (phase === "failed") return t("▲ NO LINK: use the robot's own stop switch");
  if (isCut) return t("▲ NO LINK: {reason}", { reason: fault });
  if (isConfirmed) return inTurn([t("✓ sent"), t("✓ confirmed"), t("✓ latched")]);
  if (isLatched) return inTurn([t("✓ sent"), t("✓ latched")]);
  if (phase === "") return "—";
  return phase === "sent" ? t("✓ sent") : t("… sending");
}

/**
 * @param {Element} root
 * @param {string} selector
 * @returns {HTMLElement}
 */
function find(root, selector) {
  const found = root.querySelector(selector);
  if (!(found instanceof HTMLElement)) throw new Error(`the template has no ${selector}`);
  return found;
}
