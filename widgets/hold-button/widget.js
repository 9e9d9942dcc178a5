// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").HoldState} HoldState */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */

const WORDS = { idle: "hold", asking: "…", held: "moving", spent: "let go" };

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, hold }) {
    const main = el.querySelector(".hold-button-main");
    if (!(main instanceof HTMLElement)) return {}; // no command is bound: there is nothing to do
    const root = find(el, ".hold-button");
    const word = find(el, ".hold-button-word");
    const note = find(el, ".hold-button-note");
    const level = Number(options["level"] ?? 1);
    let locked = "not ready yet";
    /** @type {HoldState} */
    let state = { phase: "idle", reason: "", values: null };

    function draw() {
      const isHeld = state.values !== null;
      const isLocked = locked !== "" && state.phase === "idle";
      attribute(root, "data-phase", isLocked ? "locked" : state.phase);
      attribute(main, "aria-pressed", String(isHeld && state.phase === "held"));
      write(word, state.phase === "spent" && !isHeld ? WORDS.idle : WORDS[state.phase]);
      const ended = state.phase === "spent" && state.reason ? `◆ ${state.reason}` : "";
      write(note, ended || (isLocked ? `◆ ${locked}` : ""));
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
        locked = held?.reason ?? "no command is bound to this button";
        draw();
      },
    };
  },
};

/**
 * @param {Element} root
 * @param {string} selector
 */
function find(root, selector) {
  const found = root.querySelector(selector);
  if (!found) throw new Error(`the template has no ${selector}`);
  return found;
}

/**
 * @param {Element} el
 * @param {string} text
 */
function write(el, text) {
  if (el.textContent !== text) el.textContent = text;
}

/**
 * @param {Element | null} el
 * @param {string} name
 * @param {string} value
 */
function attribute(el, name, value) {
  if (el && el.getAttribute(name) !== value) el.setAttribute(name, value);
}
