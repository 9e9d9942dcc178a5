// @ts-check
/**
 * STOP: what pressing it does, and what is known of it. Whoever shows it, a bar or a widget.
 *
 * @typedef {import("./drive.js").Drive} Drive
 * @typedef {import("./input.js").Input} Input
 * @typedef {import("../live/store.js").Store} Store
 * @typedef {import("../core/types.js").StopState} StopState
 */
import { takesSpace, takesText } from "./keys.js";
import { t } from "../core/words.js";

export class StopButton {
  /**
   * @param {Drive} drive
   * @param {Input} input
   * @param {Store} store
   * @param {string[]} lines the transports over which it reaches the robot
   * @param {boolean} hasKeys whether keys press it
   */
  constructor(drive, input, store, lines, hasKeys = lines.length > 0) {
    this.drive = drive;
    this.input = input;
    this.store = store;
    this.lines = lines;
    /** @type {Set<(state: StopState) => void>} */
    this.listeners = new Set();
    this.seen = "";
    /** Called at each press, here or elsewhere. */
    this.onPressed = () => {};
    if (hasKeys) {
      addEventListener("keydown", (event) => {
        if (event.key !== "Escape" || event.defaultPrevented || event.repeat) return;
        if (document.querySelector(":popover-open")) return; // it is closed by it, as everywhere
        event.preventDefault();
        this.press();
      });
      // Before anything that has the focus: while something is held, both are STOP wherever it is.
      addEventListener("keydown", (event) => this.space(event), { capture: true });
      addEventListener("keydown", (event) => this.escape(event), { capture: true });
    }
  }

  /** While something is held, Escape means nothing else. @param {KeyboardEvent} event */
  escape(event) {
    if (event.key !== "Escape" || event.repeat || !this.input.isDriving()) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.press();
  }

  /** Space is STOP; with nothing held it still presses a button that has the focus. @param {KeyboardEvent} event */
  space(event) {
    if (event.code !== "Space" || event.ctrlKey || event.altKey || event.metaKey) return;
    if (takesText(event.target) || (takesSpace(event.target) && !this.input.isDriving())) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.repeat) return;
    // A button is pressed when its key comes up: not this one.
    const end = new AbortController();
    const swallow = (/** @type {KeyboardEvent} */ up) => {
      if (up.code !== "Space") return;
      up.preventDefault();
      end.abort();
    };
    addEventListener("keyup", swallow, { capture: true, signal: end.signal });
    this.press();
  }

  press() {
    this.input.spendAll("STOP");
    this.drive.stop();
    this.heard();
  }

  /**
   * @param {(state: StopState) => void} listener
   * @param {AbortSignal} [signal]
   */
  follow(listener, signal) {
    this.listeners.add(listener);
    signal?.addEventListener("abort", () => this.listeners.delete(listener));
    listener(this.state());
  }

  /** @returns {StopState} */
  state() {
    const { drive } = this;
    const { isLatched, isConfirmed } = drive;
    const by = drive.lease?.latched || drive.posted?.latched || "";
    const phase = isLatched ? (isConfirmed ? "confirmed" : "latched") : drive.phase;
    return { phase, isLatched, isConfirmed, by, fault: this.fault() };
  }

  /** Why STOP would not reach the robot now. */
  fault() {
    if (!this.store.isUp && !this.drive.isConfirmed) return t("no connection to URC");
    const lost = this.lines.filter((line) => this.store.links.get(line)?.state === "lost");
    return lost.length > 0 ? t("the robot is not connected") : "";
  }

  /**
   * It was pressed, here or elsewhere: who follows it hears so at once, since a page that is hidden
   * draws no frames, and also when it is reset already.
   */
  heard() {
    this.onPressed();
    const state = this.state();
    if (state.phase === "") for (const listener of this.listeners) listener({ ...state, phase: "latched" });
    this.seen = ""; // told anew: what goes on by itself ends with each press
    this.frame();
  }

  frame() {
    const state = this.state();
    const look = JSON.stringify(state);
    if (look === this.seen) return;
    this.seen = look;
    for (const listener of this.listeners) listener(state);
  }
}
