// @ts-check
/**
 * Dead-man controls: while a page has one, nothing that is held counts unless one of them is open.
 *
 * One that is held is open for as long as a hand is there; one that is switched on closes by itself
 * when nothing was driven for a while. Whatever makes a page let go closes both.
 *
 * @typedef {import("../core/types.js").GateSpec} GateSpec
 *
 * @typedef {object} Keeper
 * @property {(reason: string) => void} letGo
 * @property {() => void} run Starts the sampling.
 * @property {() => boolean} isDriving Whether anything is held.
 */
import { Control, Grip } from "./grip.js";
import { t } from "../core/words.js";

/** A gate commands nothing by itself. */
const NOTHING = {
  command: "", names: {}, fixed: {}, ranges: {}, neutral: {}, line: "", refusal: "", isHeld: true,
  leaseMs: 0, isAnswered: false,
};

export class Gate {
  /**
   * @param {Keeper} keeper
   * @param {GateSpec} spec
   */
  constructor(keeper, spec) {
    this.keeper = keeper;
    this.spec = spec;
    this.isOpen = false;
    this.reason = "";
    /** When one that is switched on closes. */
    this.untilMs = 0;
    const { el, key, pad = "" } = spec;
    const keys = key ? [key, "Enter"] : ["Enter"];
    /** What is gripped, where it must be held; it also knows all the ways of letting go. */
    this.grip = new Grip(this, new Control(""), NOTHING, {
      el, keys, pad,
      ...(key && { page: () => /** @type {const} */ ("all") }),
      sample: () => ({}),
      show() {},
    });
  }

  /** Whether a hand holds it at this moment. */
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

  /** A key presses it, as it presses a button. @param {KeyboardEvent} event */
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

  /** @param {string} reason "" when a person closed it */
  close(reason) {
    if (!this.isOpen) return;
    this.isOpen = false;
    this.reason = reason;
    this.show();
    this.keeper.letGo(reason || t("the dead-man was let go"));
  }

  /** One frame. @param {number} nowMs */
  step(nowMs) {
    if (!this.isOpen) return;
    if (this.spec.isHeld) {
      this.grip.check();
    } else if (this.keeper.isDriving()) {
      this.untilMs = nowMs + this.spec.timeoutMs;
    } else if (nowMs >= this.untilMs) {
      this.close(t("nothing was driven for too long"));
    }
    this.show(nowMs);
  }

  show(nowMs = performance.now()) {
    const isTimed = this.isOpen && !this.spec.isHeld;
    const leftS = isTimed ? Math.max(0, Math.ceil((this.untilMs - nowMs) / 1000)) : 0;
    this.spec.show({ isOpen: this.isOpen, leftS, reason: this.reason });
  }

  // -- what its grip tells

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
