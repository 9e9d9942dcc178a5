// @ts-check
/**
 * The common part of driving widgets: `import { Motion, signed } from "urc/motion"`.
 *
 * A widget reports the hand's push and draws the result. This module adds the options of
 * `urc/response_curve`, the speed steps with their buttons, keys and gamepad buttons, and the note
 * with the reason why nothing moves. The template has `.NAME` with `data-phase`, `.NAME-note`, and,
 * for the speed steps, buttons with `data-speed`. A single button for the next step is added for
 * cells of low height.
 *
 * @typedef {import("./response_curve.js").Push} Push
 * @typedef {import("../core/types.js").Context} Context
 * @typedef {import("../core/types.js").Hand} Hand
 * @typedef {import("../core/types.js").HoldPhase} HoldPhase
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 * @typedef {import("../core/types.js").HoldState} HoldState
 * @typedef {import("../core/types.js").Instance} Instance
 *
 * @typedef {object} Look The state to draw.
 * @property {HoldPhase | "locked"} phase
 * @property {Push | null} push Push of the hand, as the widget reported it; null while it is not held.
 * @property {Push} values Values for the robot; all zero while it is not driven.
 *
 * @typedef {object} Own The part of one widget.
 * @property {(hand: Hand, isNew: boolean) => {push: Push, isFine?: boolean, speed?: number}} push
 *   Returns the push of the hand, from -1 to 1 by name. `isFine` marks continuous input, as of a pointer;
 *   `speed` overrides the chosen step; `isNew` is true in the first call of a gesture.
 * @property {(look: Look) => void} draw
 */
import { Pipeline, settingsOf, speedsOf } from "./response_curve.js";
import { attribute, part, write } from "./kit.js";

export class Motion {
  /**
   * @param {Context} ctx
   * @param {string} name name of the widget: its classes begin with it
   * @param {string} output
   */
  constructor(ctx, name, output) {
    const { el, options } = ctx;
    this.ctx = ctx;
    this.output = output;
    this.root = part(el, `.${name}`);
    this.note = part(el, `.${name}-note`);
    this.pipeline = new Pipeline(settingsOf(options));
    this.speeds = speedsOf(options);
    const chosen = typeof options["speed"] === "number" ? options["speed"] : this.speeds.length;
    /** Index of the speed step, from 0. */
    this.step = Math.min(this.speeds.length, Math.max(1, Math.round(chosen))) - 1;
    this.reason = ctx.t("not ready yet");
    /** Why the motion may have no effect; "" if there is no reason. */
    this.notice = "";
    /** @type {HoldState} */
    this.state = { phase: "idle", reason: "", values: null };
    /** @type {Push | null} */
    this.at = null;
    /** @type {Own} */
    this.own = { push: () => ({ push: {} }), draw() {} };
    this.buttons = [...el.querySelectorAll("[data-speed]")];
    for (const [index, button] of this.buttons.entries()) {
      button.addEventListener("click", () => this.choose(index), { signal: ctx.signal });
    }
    /** The button for the next step. */
    this.next = this.makeNext();
  }

  get speed() {
    return this.speeds[this.step] ?? 1;
  }

  /** Make the button for the next step, for cells of low height. */
  makeNext() {
    const { signal, t } = this.ctx;
    const group = this.buttons[0]?.parentElement;
    if (!group) return null;
    const button = document.createElement("button");
    const [said, now, sign] = [made("urc-hidden"), made("urc-speed-now"), made("urc-speed-sign")];
    write(said, `${t("Next speed step; now:")} `);
    write(sign, " ›");
    button.type = "button";
    button.className = "urc-speed urc-speed-next";
    button.append(said, now, sign);
    button.addEventListener("click", () => this.choose((this.step + 1) % this.speeds.length), { signal });
    group.append(button);
    return now;
  }

  /**
   * Make an element the handle of the held control.
   *
   * @param {Own & Omit<HoldSpec, "sample" | "show" | "taps" | "pace">} spec
   */
  hold({ push, draw, ...spec }) {
    this.own = { push, draw };
    this.ctx.hold(this.output, {
      ...spec,
      taps: this.taps(),
      pace: (way) => this.choose(this.step + (way === "faster" ? 1 : -1)),
      sample: (hand, dtS) => this.sample(hand, dtS),
      show: (state) => {
        this.state = state;
        if (!state.values) this.at = null; // the lever springs back; the robot was notified before
        this.draw();
      },
    });
  }

  /** Return the keys of the speed steps. */
  taps() {
    const steps = this.speeds.length > 1 ? this.speeds : [];
    return Object.fromEntries(steps.map((_, index) => [`Digit${index + 1}`, () => this.choose(index)]));
  }

  /**
   * @param {Hand} hand
   * @param {number} dtS
   */
  sample(hand, dtS) {
    const { push, isFine = true, speed = this.speed } = this.own.push(hand, this.at === null);
    this.at = push;
    return this.pipeline.step(push, { dtS, speed, isFine });
  }

  /** @param {number} index index of a speed step; others are ignored */
  choose(index) {
    if (index < 0 || index >= this.speeds.length) return;
    this.step = index;
    this.draw();
  }

  /** @returns {Instance} */
  instance() {
    this.draw();
    return {
      update: (_, outputs) => {
        this.reason = outputs[this.output]?.reason ?? this.ctx.t("no command is bound");
        this.notice = outputs[this.output]?.notice ?? "";
        this.draw();
      },
    };
  }

  draw() {
    const { t } = this.ctx;
    const { phase, reason, values } = this.state;
    const isLocked = this.reason !== "" && phase === "idle";
    attribute(this.root, "data-phase", isLocked ? "locked" : phase);
    this.buttons.forEach((button, index) => {
      attribute(button, "aria-pressed", String(index === this.step));
    });
    if (this.next) write(this.next, `${Math.round(this.speed * 100)} %`);
    let note = isLocked ? `◆ ${this.reason}` : "";
    if (phase === "asking") note = t("… taking control");
    else if (phase !== "idle" && reason) note = `◆ ${reason}`;
    if (!note && this.notice) note = `◆ ${this.notice}`;
    // The notice replaces the values, which would look as if the robot moved, or moved as fast.
    const isNoted = this.notice || (phase === "held" && reason);
    attribute(this.root, "data-notice", isNoted ? "yes" : null);
    write(this.note, note);
    const sent = phase === "held" ? /** @type {Push | null} */ (values) : null;
    // A stopped or refused gesture moves nothing, so the control is drawn at rest under the finger.
    const push = phase === "spent" ? null : this.at;
    this.own.draw({ phase: isLocked ? "locked" : phase, push, values: sent ?? {} });
  }
}

/** @param {string} name class of the element */
function made(name) {
  const span = document.createElement("span");
  span.className = name;
  return span;
}

/**
 * Return a share as text with two digits, and a sign for directions.
 *
 * @param {unknown} value
 */
export function signed(value) {
  const share = typeof value === "number" ? value : 0;
  const text = Math.abs(share).toFixed(2);
  return Number(text) === 0 ? text : `${share < 0 ? "−" : "+"}${text}`;
}

/** @typedef {readonly [string, string]} Ways Words for a positive and a negative value. */

/** @type {Record<"x" | "y", Ways>} */
const AXIS_WAYS = {
  x: [mark("forward"), mark("backward")],
  y: [mark("left"), mark("right")],
};
/** Words of arguments that name their direction. @type {Record<string, Ways>} */
const ARGUMENT_WAYS = {
  forward: [mark("forward"), mark("backward")],
  left: [mark("left"), mark("right")],
  right: [mark("right"), mark("left")],
  up: [mark("up"), mark("down")],
  clockwise: [mark("clockwise"), mark("counterclockwise")],
};

/** Mark a text for the catalogues; it is translated when it is shown. @param {string} text */
function mark(text) {
  return text;
}

/**
 * Return the words for both directions of an axis, untranslated.
 *
 * @param {"x" | "y"} axis
 * @param {import("../core/types.js").Argument | undefined} argument argument that the axis sets
 * @returns {Ways}
 */
export function waysOf(axis, argument) {
  const name = argument?.name ?? "";
  const named = Object.hasOwn(ARGUMENT_WAYS, name) ? ARGUMENT_WAYS[name] : undefined;
  return named ?? AXIS_WAYS[axis];
}

/**
 * Return a value of an axis in words, with the declared unit, such as "forward 0.18 m/s"; "" at rest.
 *
 * @param {"x" | "y"} axis
 * @param {unknown} value from -1 to 1
 * @param {import("../core/types.js").Argument | undefined} argument argument that the axis sets
 * @param {Context["t"]} t
 */
export function directed(axis, value, argument, t) {
  const { isBack, text } = amount(value, argument);
  if (!text) return "";
  const [ahead, back] = waysOf(axis, argument);
  const way = argument?.title ? `${argument.title} ${isBack ? "−" : "+"}` : `${t(isBack ? back : ahead)} `;
  return way + text;
}

/**
 * Return a value with its sign and the declared unit, such as "+0.18 m/s"; "" at rest.
 *
 * @param {unknown} value from -1 to 1
 * @param {import("../core/types.js").Argument | undefined} argument argument that the control sets
 */
export function measured(value, argument) {
  const { isBack, text } = amount(value, argument);
  return text && `${isBack ? "−" : "+"}${text}`;
}

/**
 * @param {unknown} value from -1 to 1
 * @param {import("../core/types.js").Argument | undefined} argument
 * @returns {{isBack: boolean, text: string}} `text` has no sign; "" at rest
 */
function amount(value, argument) {
  const share = typeof value === "number" ? value : 0;
  const reach = share < 0 ? -(argument?.min ?? -1) : (argument?.max ?? 1);
  const size = Math.abs(share) * Math.abs(reach);
  const digits = Math.abs(reach) < 20 ? 2 : 0;
  const figure = argument?.unit ? size.toFixed(digits) : Math.round(Math.abs(share) * 100).toFixed(0);
  return { isBack: share < 0, text: Number(figure) === 0 ? "" : `${figure} ${argument?.unit || "%"}` };
}

/**
 * Keep one axis of a control readable as a slider for screen readers. Its text changes only in
 * steps of a tenth, so that a moving hand does not cause constant speech.
 *
 * @param {Element | null} el element with the role of a slider
 * @param {unknown} value
 * @param {string} ahead word for positive values
 * @param {string} back
 */
export function speak(el, value, ahead, back) {
  if (!el) return;
  const share = Math.round((typeof value === "number" ? value : 0) * 10) / 10 + 0;
  attribute(el, "aria-valuenow", String(share));
  const words = share === 0 ? "0 %" : `${share > 0 ? ahead : back} ${Math.round(Math.abs(share) * 100)} %`;
  attribute(el, "aria-valuetext", words);
}

/**
 * Return the drag of a pointer from its start, in shares of `reach`: the start is the centre, so nothing
 * jumps.
 *
 * @param {Hand} hand
 * @param {number} reach CSS pixels at full deflection
 * @returns {{x: number, y: number}} x away from the operator, y to the left
 */
export function pulled({ x, y, startX, startY }, reach) {
  const span = reach > 0 ? reach : 1;
  return { x: (startY - y) / span, y: (startX - x) / span };
}

/**
 * Return the part of a push for a control with these axes. Another control of the same command may
 * set the other axis.
 *
 * @param {string} axes "both", "x" or "y"
 * @param {{x: number, y: number}} push
 * @returns {Push}
 */
export function along(axes, { x, y }) {
  return axes === "x" ? { x } : axes === "y" ? { y } : { x, y };
}

/** Key codes of each direction, by position, so that they are the same on every keyboard layout. */
export const DIRECTIONS = Object.freeze({
  ahead: Object.freeze(["ArrowUp", "KeyW"]),
  back: Object.freeze(["ArrowDown", "KeyS"]),
  left: Object.freeze(["ArrowLeft", "KeyA"]),
  right: Object.freeze(["ArrowRight", "KeyD"]),
});

/**
 * Return the direction of the held keys.
 *
 * @param {ReadonlySet<string>} keys
 * @returns {{x: number, y: number}} each -1, 0 or 1
 */
export function pointed(keys) {
  const is = (/** @type {readonly string[]} */ codes) => Number(codes.some((code) => keys.has(code)));
  const { ahead, back, left, right } = DIRECTIONS;
  return { x: is(ahead) - is(back), y: is(left) - is(right) };
}
