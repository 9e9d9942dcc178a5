// @ts-check
/**
 * Dead-man controls. On a page with dead-man controls, held controls count only while one of them
 * is active.
 *
 * A dead-man control for holding is active while it is held. A dead-man switch switches off after a
 * time without motion. Any event that releases held controls releases both kinds.
 *
 * @typedef {import("../core/types.js").GateSpec} GateSpec
 *
 * @typedef {object} Keeper The owner of all held controls.
 * @property {(reason: string) => void} letGo Releases everything.
 * @property {() => void} run Starts the sampling.
 * @property {() => boolean} isDriving Whether a control is held.
 */
import { Control, HeldControl } from "./held_control.js";
import { t } from "../core/words.js";

/** A dead-man control has no command. */
const NOTHING = {
  command: "", names: {}, fixed: {}, ranges: {}, neutral: {}, line: "", refusal: "", isHeld: true,
  leaseMs: 0, isAnswered: false,
};

export class DeadMan {
  /**
   * @param {Keeper} keeper
   * @param {GateSpec} spec
   */
  constructor(keeper, spec) {
    this.keeper = keeper;
    this.spec = spec;
    this.isOpen = false;
    this.reason = "";
    /** Time at which a dead-man switch switches off. */
    this.untilMs = 0;
    const { el, key, pad = "" } = spec;
    const keys = key ? [key, "Enter"] : ["Enter"];
    /** The held control of a dead-man control for holding; it handles all kinds of release. */
    this.grip = new HeldControl(this, new Control(""), NOTHING, {
      el, keys, pad,
      ...(key && { page: () => /** @type {const} */ ("all") }),
      sample: () => ({}),
      show() {},
    });
  }

  /** Whether it is currently held. */
  get isHeld() {
    return this.isOpen && this.grip.hand !== null;
  }

  /** @param {AbortSignal} signal */
  listen(signal) {
    const { el, isHeld } = this.spec;
    if (isHeld) {
      this.grip.listen(signal);
    } else {
      el.addEventListener("click", () => this.toggle(), { signal });
      el.addEventListener("keydown", (event) => this.pressed(event), { signal });
    }
    this.show();
  }

  /** Handle a key as a press of the button. @param {KeyboardEvent} event */
  pressed(event) {
    if (event.defaultPrevented || (event.code !== "Enter" && event.code !== "Space")) return;
    event.preventDefault();
    if (!event.repeat) this.toggle();
  }

  toggle() {
    if (this.isOpen) this.close("");
    else this.open();
  }

  open() {
    if (this.isOpen) return;
    this.isOpen = true;
    this.reason = "";
    this.untilMs = performance.now() + this.spec.timeoutMs;
    this.show();
    this.keeper.run();
  }

  /** @param {string} reason "" for a release by the operator */
  close(reason) {
    if (!this.isOpen) return;
    this.isOpen = false;
    this.reason = reason;
    this.show();
    this.keeper.letGo(reason || t("the dead-man control was released"));
  }

  /** Run one animation frame. @param {number} nowMs */
  step(nowMs) {
    if (!this.isOpen) return;
    if (this.spec.isHeld) {
      this.grip.check();
    } else if (this.keeper.isDriving()) {
      this.untilMs = nowMs + this.spec.timeoutMs;
    } else if (nowMs >= this.untilMs) {
      this.close(t("no control was used for too long"));
    }
    this.show(nowMs);
  }

  show(nowMs = performance.now()) {
    const isTimed = this.isOpen && !this.spec.isHeld;
    const leftS = isTimed ? Math.max(0, Math.ceil((this.untilMs - nowMs) / 1000)) : 0;
    this.spec.show({ isOpen: this.isOpen, leftS, reason: this.reason });
  }

  // -- callbacks of the held control

  begin() {
    this.open();
  }

  moved() {}

  isGuarded() {
    return false;
  }

  end() {
    this.close("");
  }

  forget() {
    this.grip.drop(["pointer", "keys", "pad"]);
    this.close("");
  }
}
