// @ts-check
/**
 * A held control, with input from a pointer, keys or a gamepad, and its command.
 *
 * Only one input at a time holds it. A lever may keep its position after the release of the
 * pointer, while another control is held. The owner of all held controls decides about the effects.
 *
 * @typedef {import("../widgets/output.js").Output} Output
 * @typedef {import("../core/types.js").Hand} Hand
 * @typedef {import("../core/types.js").HoldPhase} HoldPhase
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 * @typedef {import("../core/types.js").Value} Value
 *
 * @typedef {object} Holder The owner of all held controls.
 * @property {(grip: HeldControl) => void} begin
 * @property {(grip: HeldControl) => void} moved The input has changed.
 * @property {(grip: HeldControl) => boolean} isGuarded Whether another control is held, so that
 *   this one may keep its position.
 * @property {(grip: HeldControl) => void} end
 * @property {(grip: HeldControl) => void} forget
 * @property {(control: Control) => string} [slowNote] Why the robot moves more slowly than requested, or "".
 */
import { isDown } from "./pointer_capture.js";
import { takesKeys, takesText } from "./keys.js";
import { feel } from "./haptics.js";
import { argumentsOf } from "../widgets/output.js";
import { MergedAxes } from "./merge_axes.js";
import { t } from "../core/words.js";

/** All kinds of input, for releasing all. @type {Hand["kind"][]} */
export const ANY = ["pointer", "keys", "pad", "stay"];
/** Maximum time step for a widget; the excess of a longer gap is ignored. */
const LONGEST_STEP_S = 0.1;

/** One held command with its held controls, for example two sticks with one command. */
export class Control {
  /** @param {string} command */
  constructor(command) {
    this.command = command;
    /** @type {Set<HeldControl>} */
    this.grips = new Set();
    this.together = new MergedAxes();
    /** @type {HoldPhase} */
    this.phase = "idle";
    this.reason = "";
    /** Lease in which the command was stopped; only a later lease permits motion again. */
    this.closedEpoch = -1;
    this.epoch = 0;
    this.askedMs = 0;
    /** Time of the last tick outside an animation frame. */
    this.movedMs = -Infinity;
    this.sentMs = -Infinity;
    this.sent = "";
    this.isReleaseOwed = false;
  }

  /** The image that the command requires; undefined if none. */
  get sight() {
    return [...this.grips][0]?.output.sees;
  }

  /** Time for which motion continues after the last tick. */
  get leaseMs() {
    return Math.min(...[...this.grips].map((grip) => grip.output.leaseMs));
  }
}

/** One held control. */
export class HeldControl {
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
    /** Last sampled values by the names of the output; null while it is not held. */
    this.values = /** @type {Record<string, Value> | null} */ (null);
    this.takenMs = 0;
    this.shown = "";
  }

  /** @param {AbortSignal} signal */
  listen(signal) {
    const { el } = this.spec;
    const options = { signal };
    el.style.touchAction = "none";
    el.style.userSelect = "none";
    el.addEventListener("pointerdown", (event) => this.down(event), options);
    // The canvas for early moves must not cover buttons inside the element.
    if (!this.spec.isFree && !el.querySelector("button, a, input, [tabindex]")) hurryMoves(el);
    // Raw pointer events arrive before the animation frame, but only in secure contexts; other
    // contexts use moves.
    el.addEventListener("pointerrawupdate", (event) => this.move(/** @type {PointerEvent} */ (event)), options);
    el.addEventListener("pointermove", (event) => this.move(event), options);
    el.addEventListener("pointerup", (event) => this.up(event.pointerId, true), options);
    for (const name of /** @type {const} */ (["pointercancel", "lostpointercapture"])) {
      el.addEventListener(name, (event) => this.up(event.pointerId, false), options);
    }
    // A long press must not open a menu, select or zoom.
    el.addEventListener("touchstart", (event) => event.preventDefault(), { signal, passive: false });
    document.addEventListener("keydown", (event) => this.keyDown(event), options);
    document.addEventListener("keyup", (event) => this.keyUp(event.code), options);
    document.addEventListener("focusin", (event) => this.focusMoved(event.target), options);
    for (const place of [el, ...(this.spec.keysOn ?? [])]) {
      place.addEventListener("focusout", () => this.focusLeft(), options);
    }
    signal.addEventListener("abort", () => this.holder.forget(this));
  }

  /** @param {PointerEvent} event */
  down(event) {
    if (event.button !== 0 || (this.hand && this.hand.kind !== "stay")) return;
    if (this.spec.isFree && !this.spec.isFree(event.target)) return;
    this.pointerId = event.pointerId;
    this.spec.el.setPointerCapture(event.pointerId);
    const { clientX: x, clientY: y } = event;
    const hand = { ...this.newHand("pointer"), x, y, startX: x, startY: y };
    if (this.hand) this.hand = hand; // it had kept its position, so the gesture continues
    else this.begin(hand);
  }

  /** @param {PointerEvent} event */
  move(event) {
    const { hand } = this;
    if (hand?.kind !== "pointer" || event.pointerId !== this.pointerId) return;
    if (!isDown(event)) {
      this.up(event.pointerId, true);
      return;
    }
    if (hand.x === event.clientX && hand.y === event.clientY) return;
    hand.x = event.clientX;
    hand.y = event.clientY;
    this.holder.moved(this);
  }

  /**
   * @param {number} pointerId
   * @param {boolean} isMeant whether the operator released it intentionally
   */
  up(pointerId, isMeant) {
    if (pointerId !== this.pointerId) return;
    const { hand, spec } = this;
    if (isMeant && hand?.kind === "pointer" && spec.stays && this.holder.isGuarded(this)) {
      this.pointerId = -1;
      this.hand = { ...hand, kind: "stay" };
      this.holder.moved(this);
    } else {
      this.drop(["pointer"]);
    }
  }

  /** @param {KeyboardEvent} event */
  keyDown(event) {
    // macOS reports no key-up while Meta is down, so keys could stay held.
    if (event.key === "Meta") this.drop(["keys"]);
    const { spec } = this;
    const isTap = Object.hasOwn(spec.taps ?? {}, event.code);
    if (!isTap && !spec.keys.includes(event.code)) return;
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.defaultPrevented || !this.isHeard(event.target)) return;
    event.preventDefault(); // the arrows must not scroll
    if (event.repeat) return;
    if (isTap) {
      spec.taps?.[event.code]?.();
      return;
    }
    this.keys.add(event.code);
    if (!this.hand && this.keys.size === 1) this.begin(this.newHand("keys"));
    else if (this.hand?.kind === "keys") this.holder.moved(this);
  }

  /**
   * Whether this control accepts keys that are sent to an element.
   *
   * @param {EventTarget | null} target
   */
  isHeard(target) {
    if (this.contains(target)) return true;
    const which = this.spec.page?.() ?? "none";
    return which === "all" ? !takesText(target) : which === "free" && !takesKeys(target);
  }

  /** Whether an element is a part of this control. @param {EventTarget | null} target */
  contains(target) {
    const { el, keysOn = [] } = this.spec;
    return target instanceof Node && [el, ...keysOn].some((place) => place.contains(target));
  }

  /** @param {string} code */
  keyUp(code) {
    if (!this.keys.delete(code)) return;
    if (this.keys.size === 0) this.drop(["keys"]);
    else if (this.hand?.kind === "keys") this.holder.moved(this);
  }

  /**
   * Release keys when the focus moves to an element that uses them.
   *
   * @param {EventTarget | null} target
   */
  focusMoved(target) {
    if (this.spec.page && takesText(target)) this.drop(["keys"]);
  }

  focusLeft() {
    if (!this.spec.page) this.drop(["keys"]);
  }

  /**
   * @param {Hand["kind"]} kind
   * @returns {Hand}
   */
  newHand(kind) {
    return { kind, x: 0, y: 0, startX: 0, startY: 0, keys: this.keys, axes: [0, 0] };
  }

  /** @param {Hand} hand */
  begin(hand) {
    this.hand = hand;
    this.take(performance.now(), true);
    this.holder.begin(this);
  }

  /**
   * Release the control if one of these kinds of input holds it.
   *
   * @param {Hand["kind"][]} kinds
   */
  drop(kinds) {
    if (kinds.includes("keys")) this.keys.clear();
    if (!this.hand || !kinds.includes(this.hand.kind)) return;
    const { el } = this.spec;
    const pointerId = this.hand.kind === "pointer" ? this.pointerId : -1;
    this.hand = null;
    this.values = null;
    this.pointerId = -1;
    if (pointerId >= 0 && el.hasPointerCapture(pointerId)) el.releasePointerCapture(pointerId);
    this.holder.end(this);
  }

  /** Release a lost pointer, which browsers report only with the next move. */
  check() {
    if (this.hand?.kind === "stay" && !this.holder.isGuarded(this)) this.drop(["stay"]);
    if (this.hand?.kind !== "pointer") return;
    if (!this.spec.el.hasPointerCapture(this.pointerId)) this.drop(["pointer"]);
  }

  /**
   * Sample the widget for the present input.
   *
   * @param {number} nowMs
   * @param {boolean} isNew whether the motion begins now, from zero
   */
  take(nowMs, isNew = false) {
    if (!this.hand) return;
    const gapS = Math.max(0.0001, (nowMs - this.takenMs) / 1000);
    this.takenMs = nowMs;
    this.values = this.spec.sample(this.hand, isNew ? 0 : Math.min(LONGEST_STEP_S, gapS));
  }

  /** @returns {Record<string, Value>} the sampled values, by the names of the command */
  given() {
    return this.values ? argumentsOf(this.output, this.values) : {};
  }

  /**
   * Return the sampled values without arguments that another input sets.
   *
   * @param {ReadonlySet<string>} lost arguments that belong to another input
   */
  counted(lost) {
    if (!this.values || lost.size === 0) return this.values;
    const moved = Object.entries(this.output.names);
    const isVain = (/** @type {string} */ name) => {
      const targets = moved.filter(([, source]) => source === name);
      return targets.length > 0 && targets.every(([target]) => lost.has(target));
    };
    const pairs = Object.entries(this.values).map(([name, value]) => [name, isVain(name) ? 0 : value]);
    return /** @type {Record<string, Value>} */ (Object.fromEntries(pairs));
  }

  /** @param {boolean} isForced */
  show(isForced = false) {
    const { phase, together } = this.control;
    const lost = together.lost(this);
    const values = this.counted(lost);
    const slow = this.holder.slowNote?.(this.control) ?? "";
    const reason = this.control.reason || slow || (lost.size > 0 ? t("Another control sets this value: let go, then start again") : "");
    const kind = this.hand?.kind ?? "";
    const look = `${phase} ${reason} ${kind} ${JSON.stringify(values)}`;
    if (look === this.shown && !isForced) return;
    this.shown = look;
    const isHeld = this.hand !== null;
    feel(this, isHeld, phase === "spent", values);
    this.spec.show({ phase: isHeld || phase === "spent" ? phase : "idle", reason, values });
  }
}

/**
 * Get pointer moves without the delay to the next animation frame.
 *
 * Raw pointer events exist only in secure contexts, and a dashboard on a local network has none.
 * But all browsers have desynchronized canvases, which deliver moves immediately. An empty canvas
 * therefore covers the element. Without such canvases, moves arrive with the animation frames.
 *
 * @param {HTMLElement} el receives the pointer events of its children
 */
function hurryMoves(el) {
  if ("onpointerrawupdate" in window) return;
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 1;
  const pen = canvas.getContext("2d", { desynchronized: true });
  if (!pen?.getContextAttributes?.().desynchronized) return;
  canvas.ariaHidden = "true";
  Object.assign(canvas.style, { position: "absolute", inset: "0", width: "100%", height: "100%" });
  if (getComputedStyle(el).position === "static") el.style.position = "relative";
  el.append(canvas);
}
