// @ts-check
/**
 * STOP: the action of its buttons, and its state for the bar and for widgets.
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
   * @param {string[]} lines transports over which it reaches the robot
   * @param {boolean} hasKeys whether keys trigger it
   */
  constructor(drive, input, store, lines, hasKeys = lines.length > 0) {
    this.drive = drive;
    this.input = input;
    this.store = store;
    this.lines = lines;
    /** @type {Set<(state: StopState) => void>} */
    this.listeners = new Set();
    this.seen = "";
    /** Commands and sequences with autonomous motion under way, of all screens. @type {readonly string[]} */
    this.moving = [];
    /** Called at each press on this or another page. */
    this.onPressed = () => {};
    if (hasKeys) {
      addEventListener("keydown", (event) => {
        if (event.key !== "Escape" || event.defaultPrevented || event.repeat) return;
        if (document.querySelector(":popover-open")) return; // Escape closes the popover
        event.preventDefault();
        if (closePanel()) return;
        this.press();
      });
      // In the capture phase, because both keys mean STOP during a hold, regardless of the focus.
      addEventListener("keydown", (event) => this.space(event), { capture: true });
      addEventListener("keydown", (event) => this.escape(event), { capture: true });
    }
  }

  /** Whether the robot moves, as far as this page knows: by a held control, or by itself. */
  get isMotion() {
    return this.input.isDriving() || this.moving.length > 0 || document.querySelector("[data-moving]") !== null;
  }

  /** Handle Escape, which means only STOP during motion. @param {KeyboardEvent} event */
  escape(event) {
    if (event.key !== "Escape" || event.repeat || !this.isMotion) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    this.press();
  }

  /**
   * Handle Space, which means STOP during a hold, and otherwise presses the focused button.
   *
   * @param {KeyboardEvent} event
   */
  space(event) {
    if (event.code !== "Space" || event.ctrlKey || event.altKey || event.metaKey) return;
    if (takesText(event.target) || (takesSpace(event.target) && !this.input.isDriving())) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (event.repeat) return;
    // Ignore this key-up, because buttons act on key-up.
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
    this.drive.stop(); // first: `spendAll` calls widgets
    this.input.spendAll("STOP");
    this.heard();
  }

  /**
   * Take over presses from `early_stop.js`, and repeat a press that it has not delivered yet.
   *
   * @param {HTMLElement} root the element with the URL of STOP
   */
  takeOver(root) {
    root.addEventListener("urc-early-stop", (event) => {
      event.preventDefault();
      this.press();
    });
    if (!["sending", "fault"].includes(root.dataset["stopSent"] ?? "")) return;
    root.dataset["stopSent"] = "taken";
    this.press();
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
    const known = isLatched ? (isConfirmed ? "confirmed" : "latched") : drive.phase;
    const phase = drive.phase === "failed" ? "failed" : known;
    return { phase, isLatched, isConfirmed, by, fault: this.fault() };
  }

  /** Reason why STOP cannot reach the robot now. */
  fault() {
    if (!this.store.isUp && !this.drive.isConfirmed) return t("no connection to URC");
    const lost = this.lines.filter((line) => this.store.links.get(line)?.state === "lost");
    return lost.length > 0 ? t("the robot is not connected") : "";
  }

  /**
   * Report a press on this or another page immediately, because hidden pages draw no frames, and
   * the latch may already be reset.
   */
  heard() {
    this.onPressed();
    const state = this.state();
    if (state.phase === "") for (const listener of this.listeners) listener({ ...state, phase: "latched" });
    this.seen = ""; // reported again, because each press ends autonomous motion
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

/** Close the open sheet of connection and log; return whether there was one. */
function closePanel() {
  const panel = document.querySelector("[data-panel][open]");
  if (!(panel instanceof HTMLDetailsElement)) return false;
  panel.open = false;
  return true;
}
