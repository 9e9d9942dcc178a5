// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/types.js").Outlet} Outlet */

/** @typedef {"" | "asking" | "pending" | "done" | "failed"} Phase */

/** How long a question stands, and how long what was done is told. */
const ASK_MS = 5000;
const TELL_MS = 4000;
/** A second tap of the same finger is no answer to a question that it has not seen. */
const READ_MS = 400;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, send, signal }) {
    if (!el.querySelector(".button-main")) return {}; // no command is bound: there is nothing to do
    const button = new Button(el, () => send("press"));
    const on = (/** @type {string} */ selector, /** @type {() => void} */ listener) => {
      el.querySelector(selector)?.addEventListener("click", listener, { signal });
    };
    on(".button-main", () => button.press());
    on(".button-yes", () => button.answer(true));
    on(".button-no", () => button.answer(false));
    const key = (/** @type {KeyboardEvent} */ event) => {
      if (event.key === "Escape" && button.phase === "asking") {
        event.preventDefault(); // it means no, and not STOP
        button.answer(false);
      }
      // A key that is held down repeats its clicks: that is one tap.
      if (event.repeat && event.key === "Enter") event.preventDefault();
    };
    el.addEventListener("keydown", key, { signal });
    return {
      update({ state }, { press }) {
        button.update(state, press);
      },
      destroy() {
        button.end();
      },
    };
  },
};

/** One command: asked for, under way, done or failed. Nothing is ever given twice. */
class Button {
  /**
   * @param {HTMLElement} el
   * @param {() => Promise<unknown>} give
   */
  constructor(el, give) {
    this.give = give;
    this.root = find(el, ".button");
    this.main = find(el, ".button-main");
    this.note = find(el, ".button-note");
    this.value = el.querySelector(".button-value");
    this.question = el.querySelector(".button-question");
    this.yes = el.querySelector(".button-yes");
    /** @type {Phase} */
    this.phase = "";
    this.outcome = "";
    this.reason = "not ready yet";
    this.isAnswered = false;
    /** What is known of the state: its age, or the limit it has passed. */
    this.stateNote = "";
    /** @type {number | undefined} */
    this.timer = undefined;
    /** @type {number | undefined} */
    this.reading = undefined;
  }

  /**
   * @param {Reading | undefined} state
   * @param {Outlet | undefined} press
   */
  update(state, press) {
    this.reason = press?.reason ?? "no command is bound to this button";
    this.isAnswered = press?.isAnswered ?? false;
    if (state) {
      this.stateNote = noteOf(state);
      attribute(this.root, "data-state", state.state);
      attribute(this.root, "data-alarm", state.alarm);
      if (this.value) write(this.value, textOf(state));
    }
    if (this.reason && this.phase === "asking") this.answer(false);
    this.show();
  }

  press() {
    if (this.reason || this.phase === "asking" || this.phase === "pending") return;
    if (this.question) this.ask();
    else void this.run();
  }

  ask() {
    this.become("asking", "", ASK_MS);
    if (this.yes instanceof HTMLButtonElement) {
      const yes = this.yes;
      yes.disabled = true;
      this.reading = window.setTimeout(() => (yes.disabled = false), READ_MS);
    }
    focus(this.question?.querySelector(".button-no"));
  }

  /** @param {boolean} isYes */
  answer(isYes) {
    if (this.phase !== "asking") return;
    const hadFocus = this.question?.contains(document.activeElement) ?? false;
    this.become("");
    if (hadFocus) focus(this.main);
    if (isYes && !this.reason) void this.run();
  }

  async run() {
    this.become("pending", this.isAnswered ? "… waiting for the robot" : "… sending");
    try {
      await this.give();
      this.become("done", this.isAnswered ? "✓ done" : "✓ sent", TELL_MS);
    } catch (error) {
      this.become("failed", `▲ ${error instanceof Error ? error.message : error}`);
    }
  }

  /**
   * @param {Phase} phase
   * @param {string} outcome
   * @param {number} forMs 0: until something happens
   */
  become(phase, outcome = "", forMs = 0) {
    this.end();
    this.phase = phase;
    this.outcome = outcome;
    if (forMs > 0) {
      this.timer = window.setTimeout(() => {
        if (this.phase === "asking") this.answer(false);
        else this.become("");
      }, forMs);
    }
    this.show();
  }

  show() {
    const isAsking = this.phase === "asking";
    const isLocked = this.reason !== "" || this.phase === "pending";
    attribute(this.root, "data-phase", this.phase);
    attribute(this.main, "aria-disabled", String(isLocked));
    attribute(this.main, "aria-busy", String(this.phase === "pending"));
    if (this.main instanceof HTMLElement) this.main.hidden = isAsking;
    if (this.question instanceof HTMLElement) this.question.hidden = !isAsking;
    const hindrance = this.reason ? `◆ ${this.reason}` : "";
    write(this.note, [this.outcome, hindrance, this.stateNote].filter(Boolean).join(" · "));
  }

  end() {
    clearTimeout(this.timer);
    clearTimeout(this.reading);
  }
}

const ALARMS = {
  "": "",
  lolo: "▲ Very low",
  low: "◆ Low",
  high: "◆ High",
  hihi: "▲ Very high",
};

/** @param {Reading} state */
function noteOf(state) {
  if (state.state === "none") return "no value yet";
  if (state.state === "gone") return `last seen ${state.age} ago`;
  const old = state.state === "stale" ? `${state.age} old` : "";
  return [ALARMS[state.alarm], old].filter(Boolean).join(" · ");
}

/** @param {Reading} state */
function textOf({ value, text }) {
  return typeof value === "boolean" && text === String(value) ? (value ? "on" : "off") : text;
}

/** @param {Element | null | undefined} el */
function focus(el) {
  if (el instanceof HTMLElement) el.focus();
}

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
 * @param {Element} el
 * @param {string} name
 * @param {string} value
 */
function attribute(el, name, value) {
  if (el.getAttribute(name) !== value) el.setAttribute(name, value);
}
