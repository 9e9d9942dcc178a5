// @ts-check
/**
 * What widgets that drive have in common: `import { Motion, signed } from "urc/motion"`.
 *
 * A widget says how far a hand pushes, and draws what was made of it. In between lie the options of
 * `urc/curve`, the speed steps with their buttons, keys and buttons of the gamepad, and the line
 * that says why nothing moves. Its template has `.NAME` with `data-phase`, `.NAME-note`, and, for the
 * speed steps, buttons with `data-speed`. Beside them comes one that goes to the next step, for cells
 * too low for all.
 *
 * @typedef {import("./curve.js").Push} Push
 * @typedef {import("../core/types.js").Context} Context
 * @typedef {import("../core/types.js").Hand} Hand
 * @typedef {import("../core/types.js").HoldPhase} HoldPhase
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 * @typedef {import("../core/types.js").HoldState} HoldState
 * @typedef {import("../core/types.js").Instance} Instance
 *
 * @typedef {object} Look What is to be drawn.
 * @property {HoldPhase | "locked"} phase
 * @property {Push | null} push Where the hand is, as the widget said; null while nothing holds it.
 * @property {Push} values What the robot is told; all nothing while it is not.
 *
 * @typedef {object} Own What a widget that drives says of itself.
 * @property {(hand: Hand, isNew: boolean) => {push: Push, isFine?: boolean, speed?: number}} push
 *   How far the hand pushes, from -1 to 1 by name. `isFine` when by degrees, as a pointer does;
 *   `speed` where it is not the chosen step; `isNew` in the first call of a gesture.
 * @property {(look: Look) => void} draw
 */
import { Pipeline, settingsOf, speedsOf } from "./curve.js";
import { attribute, part, write } from "./kit.js";

export class Motion {
  /**
   * @param {Context} ctx
   * @param {string} name of the widget: its classes begin with it
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
    /** Which speed step, from 0. */
    this.step = Math.min(this.speeds.length, Math.max(1, Math.round(chosen))) - 1;
    this.reason = ctx.t("not ready yet");
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
    /** What it says of the step. */
    this.next = this.makeNext();
  }

  get speed() {
    return this.speeds[this.step] ?? 1;
  }

  /** One button in the place of the steps, where a cell is too low for them: it goes to the next. */
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
   * Make an element the grip.
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
        if (!state.values) this.at = null; // it springs back; what counts was sent before
        this.draw();
      },
    });
  }

  /** One key for each speed step. */
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

  /** @param {number} index of a speed step; beyond the ends nothing happens */
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
    if (phase === "asking") note = t("… taking the controls");
    else if (phase !== "idle" && reason) note = `◆ ${reason}`;
    write(this.note, note);
    const sent = phase === "held" ? /** @type {Push | null} */ (values) : null;
    this.own.draw({ phase: isLocked ? "locked" : phase, push: this.at, values: sent ?? {} });
  }
}

/** @param {string} name of its class */
function made(name) {
  const span = document.createElement("span");
  span.className = name;
  return span;
}

/**
 * Return a share for people: two digits, and a sign where there is a direction.
 *
 * @param {unknown} value
 */
export function signed(value) {
  const share = typeof value === "number" ? value : 0;
  const text = Math.abs(share).toFixed(2);
  return Number(text) === 0 ? text : `${share < 0 ? "−" : "+"}${text}`;
}

/**
 * Keep one axis of a control as a slider for those who cannot see it. What is said changes by tenths
 * only: nobody wants to hear every step of a moving hand.
 *
 * @param {Element | null} el with the role of a slider
 * @param {unknown} value
 * @param {string} ahead in words, for what is above nothing
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
 * Return how far a pointer was pulled from where it went down, in shares of `reach`: what was
 * touched first is the centre, so nothing jumps.
 *
 * @param {Hand} hand
 * @param {number} reach CSS pixels of a full push
 * @returns {{x: number, y: number}} away from the person is x, to the left y
 */
export function pulled({ x, y, startX, startY }, reach) {
  const span = reach > 0 ? reach : 1;
  return { x: (startY - y) / span, y: (startX - x) / span };
}

/**
 * Return of a push what a control with these axes has: another control of the same command may give
 * the other one.
 *
 * @param {string} axes "both", "x" or "y"
 * @param {{x: number, y: number}} push
 * @returns {Push}
 */
export function along(axes, { x, y }) {
  return axes === "x" ? { x } : axes === "y" ? { y } : { x, y };
}

/** Codes of the keys of each direction: by place, so that they are the same on every layout. */
export const DIRECTIONS = Object.freeze({
  ahead: Object.freeze(["ArrowUp", "KeyW"]),
  back: Object.freeze(["ArrowDown", "KeyS"]),
  left: Object.freeze(["ArrowLeft", "KeyA"]),
  right: Object.freeze(["ArrowRight", "KeyD"]),
});

/**
 * Return where the keys that are down point.
 *
 * @param {ReadonlySet<string>} keys
 * @returns {{x: number, y: number}} each -1, 0 or 1
 */
export function pointed(keys) {
  const is = (/** @type {readonly string[]} */ codes) => Number(codes.some((code) => keys.has(code)));
  const { ahead, back, left, right } = DIRECTIONS;
  return { x: is(ahead) - is(back), y: is(left) - is(right) };
}
