// @ts-check
/**
 * One thing that a hand can hold, and the command that it moves.
 *
 * A grip is held by one hand at a time: the pointer that went down first, keys, or a gamepad. What
 * it does with that is up to whoever holds all of them.
 *
 * @typedef {import("./output.js").Output} Output
 * @typedef {import("./types.js").Hand} Hand
 * @typedef {import("./types.js").HoldPhase} HoldPhase
 * @typedef {import("./types.js").HoldSpec} HoldSpec
 * @typedef {import("./types.js").Value} Value
 *
 * @typedef {object} Holder
 * @property {(grip: Grip) => void} begin
 * @property {(grip: Grip) => void} end
 * @property {(grip: Grip) => void} forget
 */
import { argumentsOf } from "./output.js";

/** One held command, and the grips that hold it now: two sticks may share a command. */
export class Control {
  /** @param {string} command */
  constructor(command) {
    this.command = command;
    /** @type {Set<Grip>} */
    this.grips = new Set();
    /** @type {HoldPhase} */
    this.phase = "idle";
    this.reason = "";
    /** Lease in which it was stopped: it moves again in a later one only. */
    this.closedEpoch = -1;
    this.epoch = 0;
    this.askedMs = 0;
    this.sentMs = -Infinity;
    this.sent = "";
    this.isReleaseOwed = false;
  }
}

/** One thing that a hand can hold. */
export class Grip {
  /**
   * @param {Holder} holder
   * @param {Control} control
   * @param {Output} output
   * @param {HoldSpec} spec
   */
  constructor(holder, control, output, spec) {
    this.holder = holder;
    this.control = control;
    this.output = output;
    this.spec = spec;
    /** @type {Hand | null} */
    this.hand = null;
    this.pointerId = -1;
    /** @type {Set<string>} */
    this.keys = new Set();
    this.shown = "";
  }

  /** @param {AbortSignal} signal */
  listen(signal) {
    const { el } = this.spec;
    const options = { signal };
    el.style.touchAction = "none";
    el.style.userSelect = "none";
    el.addEventListener("pointerdown", (event) => this.down(event), options);
    el.addEventListener("pointermove", (event) => this.move(event), options);
    for (const name of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) {
      el.addEventListener(name, (event) => this.up(event.pointerId), options);
    }
    // A long press must stay a press: no menu, no selection, no zoom.
    el.addEventListener("touchstart", (event) => event.preventDefault(), { signal, passive: false });
    el.addEventListener("keydown", (event) => this.keyDown(event), options);
    el.addEventListener("keyup", (event) => this.keyUp(event.code), options);
    el.addEventListener("blur", () => this.drop(["keys"]), options);
    signal.addEventListener("abort", () => this.holder.forget(this));
  }

  /** @param {PointerEvent} event */
  down(event) {
    if (event.button !== 0 || this.hand) return;
    this.pointerId = event.pointerId;
    this.spec.el.setPointerCapture(event.pointerId);
    const { clientX: x, clientY: y } = event;
    this.begin({ kind: "pointer", x, y, startX: x, startY: y, keys: this.keys, axes: [0, 0] });
  }

  /** @param {PointerEvent} event */
  move(event) {
    if (this.hand?.kind !== "pointer" || event.pointerId !== this.pointerId) return;
    this.hand.x = event.clientX;
    this.hand.y = event.clientY;
  }

  /** @param {number} pointerId */
  up(pointerId) {
    if (pointerId === this.pointerId) this.drop(["pointer"]);
  }

  /** @param {KeyboardEvent} event */
  keyDown(event) {
    if (!this.spec.keys.includes(event.code)) return;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    event.preventDefault(); // the arrows must not scroll
    if (event.repeat) return;
    this.keys.add(event.code);
    if (!this.hand && this.keys.size === 1) {
      this.begin({ kind: "keys", x: 0, y: 0, startX: 0, startY: 0, keys: this.keys, axes: [0, 0] });
    }
  }

  /** @param {string} code */
  keyUp(code) {
    this.keys.delete(code);
    if (this.keys.size === 0) this.drop(["keys"]);
  }

  /** @param {Hand} hand */
  begin(hand) {
    this.hand = hand;
    this.holder.begin(this);
  }

  /**
   * Let go, if it is held by one of these kinds of hand.
   *
   * @param {Hand["kind"][]} kinds
   */
  drop(kinds) {
    if (kinds.includes("keys")) this.keys.clear();
    if (!this.hand || !kinds.includes(this.hand.kind)) return;
    const { el } = this.spec;
    const pointerId = this.hand.kind === "pointer" ? this.pointerId : -1;
    this.hand = null;
    this.pointerId = -1;
    if (pointerId >= 0 && el.hasPointerCapture(pointerId)) el.releasePointerCapture(pointerId);
    this.holder.end(this);
  }

  /** Let go of a pointer that was taken away: a browser tells that with the next move only. */
  check() {
    if (this.hand?.kind !== "pointer") return;
    if (!this.spec.el.hasPointerCapture(this.pointerId)) this.drop(["pointer"]);
  }

  /** @returns {Record<string, Value>} by the command's own names */
  sample() {
    if (!this.hand) return {};
    return argumentsOf(this.output, this.spec.sample(this.hand));
  }

  /** @param {boolean} isForced */
  show(isForced = false) {
    const { phase, reason } = this.control;
    const isHeld = this.hand !== null;
    const values = this.hand ? this.spec.sample(this.hand) : null;
    const look = `${phase} ${reason} ${isHeld} ${JSON.stringify(values)}`;
    if (look === this.shown && !isForced) return;
    this.shown = look;
    this.spec.show({ phase: isHeld || phase === "spent" ? phase : "idle", reason, values });
  }
}
