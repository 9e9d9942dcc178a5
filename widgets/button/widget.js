// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { CommandState, slide } from "urc/command_kit";
import { attribute, noteOf, part, style, write } from "urc/kit";
import { listen } from "./gesture.js";

/** Time limit of a question. */
const ASK_MS = 5000;
/** Time after the first tap in which taps do not count: the operator has not read the question yet. */
const READ_MS = 400;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    if (!ctx.el.querySelector(".button-main")) return {}; // no command is bound
    const button = new Button(ctx);
    return {
      update({ state }, { press }) {
        button.update(state);
        button.giver.take(press);
      },
      destroy() {
        button.end();
      },
    };
  },
};

/** One command with its confirmation and state. A command is never sent twice. */
class Button {
  /** @param {Context} ctx */
  constructor(ctx) {
    const { el, options, signal, send, t } = ctx;
    this.t = t;
    this.root = part(el, ".button");
    this.main = part(el, ".button-main");
    this.note = part(el, ".button-note");
    this.value = el.querySelector(".button-value");
    this.doneHint = el.querySelector(".button-done");
    this.question = el.querySelector(".button-question");
    this.yes = el.querySelector(".button-yes");
    this.cooldownMs = 1000 * Number(options["cooldown"] ?? 0);
    /** @type {unknown[]} States in which the command has nothing to do. */
    this.doneIn = Array.isArray(options["done_in"]) ? options["done_in"] : [];
    /** @type {unknown[]} States in which it usually has nothing to do, but must work. */
    this.idleIn = Array.isArray(options["idle_in"]) ? options["idle_in"] : [];
    /** The robot's word for such a state while the robot is in it; otherwise "". */
    this.idle = "";
    /** The robot's word for a state of `done_in` while the robot is in it; otherwise "". */
    this.done = "";
    this.isAsking = false;
    this.coldMs = -Infinity;
    /** Note about the state: its age, or the exceeded limit. */
    this.stateNote = "";
    /** @type {number | undefined} */
    this.asking = undefined;
    /** @type {number | undefined} */
    this.reading = undefined;
    /** @type {number | undefined} */
    this.cooling = undefined;
    this.giver = new CommandState({ give: () => send("press"), show: () => this.show(), t, signal });
    const gesture = options["gesture"];
    const isReady = () => this.isFree;
    if (gesture === "slide") {
      const label = part(el, ".button-label").textContent;
      slide(this.main, { label, isReady, done: () => this.press(), onStop: ctx.onStop, signal });
    } else if (gesture === "tap" || gesture === "double" || gesture === "hold" || gesture === "repeat") {
      const end = listen(this.main, {
        gesture,
        repeatMs: Number(options["repeat_ms"] ?? 250),
        // A repeat skips a pending or cooling command. Without the robot, the gesture ends.
        isReady: gesture === "repeat" ? () => this.giver.isReady : isReady,
        done: () => this.press(),
        progress: (share) => style(this.main, "--button-share", share.toFixed(2)),
        signal,
      });
      ctx.onStop(({ phase }) => {
        if (phase !== "") end();
      });
    }
    el.querySelector(".button-yes")?.addEventListener("click", () => this.answer(true), { signal });
    el.querySelector(".button-no")?.addEventListener("click", () => this.answer(false), { signal });
    el.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !this.isAsking) return;
      event.preventDefault(); // here, Escape means no instead of STOP
      this.answer(false);
    }, { signal });
  }

  get isCold() {
    return performance.now() < this.coldMs;
  }

  get isFree() {
    return this.giver.isReady && !this.giver.isPending && !this.isAsking && !this.isCold && this.done === "";
  }

  /** @param {Reading | undefined} state */
  update(state) {
    if (!state) return;
    this.stateNote = noteOf(state, this.t);
    // An old state may be wrong, and then the command may be needed.
    const isDone = state.state === "live" && this.doneIn.includes(String(state.value));
    this.done = isDone ? textOf(state, this.t) : "";
    const isIdle = state.state === "live" && this.idleIn.includes(String(state.value));
    this.idle = isIdle ? textOf(state, this.t) : "";
    attribute(this.root, "data-state", state.state);
    attribute(this.root, "data-alarm", state.alarm);
    if (this.value) write(this.value, textOf(state, this.t));
  }

  press() {
    if (!this.isFree) return;
    if (this.question) this.ask();
    else void this.run();
  }

  ask() {
    this.isAsking = true;
    this.giver.become("");
    this.asking = window.setTimeout(() => this.answer(false), ASK_MS);
    if (this.yes instanceof HTMLButtonElement) {
      const yes = this.yes;
      yes.disabled = true;
      this.reading = window.setTimeout(() => (yes.disabled = false), READ_MS);
    }
    focus(this.question?.querySelector(".button-no"));
  }

  /** @param {boolean} isYes */
  answer(isYes) {
    if (!this.isAsking) return;
    const hadFocus = this.question?.contains(document.activeElement) ?? false;
    this.isAsking = false;
    clearTimeout(this.asking);
    clearTimeout(this.reading);
    this.show();
    if (hadFocus) focus(this.main);
    if (isYes) void this.run();
  }

  async run() {
    if (this.cooldownMs > 0) {
      this.coldMs = performance.now() + this.cooldownMs;
      clearInterval(this.cooling);
      this.cooling = window.setInterval(() => this.show(), 250);
    }
    await this.giver.once();
  }

  show() {
    const { giver } = this;
    if (giver.reason && this.isAsking) return this.answer(false);
    const isCold = this.isCold;
    if (!isCold) clearInterval(this.cooling);
    const leftS = Math.ceil((this.coldMs - performance.now()) / 1000);
    const wait = isCold && !giver.isPending ? this.t("ready in {seconds} s", { seconds: leftS }) : "";
    // A reason of the page comes first, and has the same place.
    const isDone = this.done !== "" && !giver.isPending && !giver.reason;
    const isIdle = this.idle !== "" && !giver.isPending && !giver.reason;
    const known = isDone ? this.done : isIdle ? this.idle : "";
    const done = known ? this.t("already {state}", { state: known }) : "";
    attribute(this.root, "data-idle", isIdle ? "yes" : null);
    if (this.doneHint) write(this.doneHint, done);
    attribute(this.root, "data-phase", this.isAsking ? "asking" : giver.phase);
    attribute(this.main, "aria-disabled", String(!giver.isReady || giver.isPending || isCold || isDone));
    attribute(this.main, "aria-busy", String(giver.isPending));
    this.main.hidden = this.isAsking;
    if (this.question instanceof HTMLElement) this.question.hidden = !this.isAsking;
    write(this.note, giver.note(wait, this.doneHint ? "" : done, this.stateNote));
  }

  end() {
    clearTimeout(this.asking);
    clearTimeout(this.reading);
    clearInterval(this.cooling);
  }
}

/**
 * @param {Reading} state
 * @param {Context["t"]} t
 */
function textOf({ value, text }, t) {
  if (typeof value !== "boolean" || text !== String(value)) return text;
  return value ? t("on") : t("off");
}

/** @param {Element | null | undefined} el */
function focus(el) {
  if (el instanceof HTMLElement) el.focus();
}
