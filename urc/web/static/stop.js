// @ts-check
/**
 * STOP: what pressing it does, and what is known of it. Whoever shows it, a bar or a widget.
 *
 * @typedef {import("./drive.js").Drive} Drive
 * @typedef {import("./input.js").Input} Input
 * @typedef {import("./store.js").Store} Store
 * @typedef {import("./types.js").StopState} StopState
 */

export class StopButton {
  /**
   * @param {Drive} drive
   * @param {Input} input
   * @param {Store} store
   * @param {string[]} lines the transports that carry motion
   */
  constructor(drive, input, store, lines) {
    this.drive = drive;
    this.input = input;
    this.store = store;
    this.lines = lines;
    /** @type {Set<(state: StopState) => void>} */
    this.listeners = new Set();
    this.seen = "";
    if (lines.length > 0) {
      addEventListener("keydown", (event) => {
        if (event.key !== "Escape" || event.defaultPrevented || event.repeat) return;
        event.preventDefault();
        this.press();
      });
    }
  }

  press() {
    this.input.spendAll("STOP");
    this.drive.stop();
    this.frame();
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
    if (!this.store.isUp && !this.drive.isConfirmed) return "no connection to URC";
    const lost = this.lines.filter((line) => this.store.links.get(line)?.state === "lost");
    return lost.length > 0 ? "the robot is not connected" : "";
  }

  frame() {
    const state = this.state();
    const look = JSON.stringify(state);
    if (look === this.seen) return;
    this.seen = look;
    for (const listener of this.listeners) listener(state);
  }
}
