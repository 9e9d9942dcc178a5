// @ts-check
/**
 * One command of a widget, with its state. The module uses no socket and no store.
 *
 * @typedef {import("../core/types.js").Outlet} Outlet
 * @typedef {import("../core/types.js").StopState} StopState
 * @typedef {import("../core/types.js").Value} Value
 * @typedef {(text: string, names?: Record<string, string | number>) => string} T
 * @typedef {"" | "pending" | "done" | "failed"} Phase
 */

/** Time for which a result is shown. */
const TELL_MS = 4000;

/** One command, which is pending, done or failed. */
export class CommandState {
  /**
   * @param {object} spec
   * @param {(args: Record<string, Value>) => Promise<unknown>} spec.give
   * @param {() => void} spec.show called for each change of the state
   * @param {T} spec.t
   * @param {AbortSignal} spec.signal
   * @param {number} [spec.everyMs] shortest interval of `newest`
   * @param {(listener: (state: StopState) => void) => void} [spec.onStop] reports STOP, which cancels a
   *   pending `newest`
   */
  constructor({ give, show, t, signal, everyMs = 100, onStop }) {
    this.give = give;
    this.show = show;
    this.t = t;
    this.everyMs = everyMs;
    /** @type {Phase} */
    this.phase = "";
    this.outcome = "";
    this.reason = t("not ready yet");
    this.notice = "";
    this.isAnswered = false;
    this.isOver = false;
    /** Arguments of the next command. @type {Record<string, Value> | null} */
    this.next = null;
    this.givenMs = -Infinity;
    /** @type {number | undefined} */
    this.telling = undefined;
    /** @type {number | undefined} */
    this.pacing = undefined;
    onStop?.(({ phase }) => {
      if (phase !== "") this.next = null;
    });
    signal.addEventListener("abort", () => {
      this.isOver = true;
      this.next = null;
      clearTimeout(this.telling);
      clearTimeout(this.pacing);
    });
  }

  get isReady() {
    return this.reason === "";
  }

  get isPending() {
    return this.phase === "pending";
  }

  /** @param {Outlet | undefined} outlet the argument of `update` */
  take(outlet) {
    this.reason = outlet ? outlet.reason : this.t("no command is bound here");
    this.notice = outlet?.notice ?? "";
    this.isAnswered = outlet?.isAnswered ?? false;
    if (this.reason) this.next = null; // a blocked command is never sent later
    this.show();
  }

  /**
   * Send the command, unless it is already pending.
   *
   * @param {Record<string, Value>} [args]
   * @returns {Promise<boolean>} whether it succeeded
   */
  async once(args = {}) {
    if (!this.isReady || this.isPending || this.isOver) return false;
    this.become("pending", this.isAnswered ? this.t("… waiting for the robot") : this.t("… sending"));
    this.givenMs = performance.now();
    try {
      await this.give(args);
      this.become("done", this.isAnswered ? this.t("✓ done") : this.t("✓ sent"), TELL_MS);
      return true;
    } catch (error) {
      const isOurs = error instanceof Error && error.name === "Cancelled";
      const text = error instanceof Error ? error.message : String(error);
      if (isOurs) this.become("", `○ ${text}`, TELL_MS);
      else this.become("failed", `▲ ${text}`);
      return false;
    }
  }

  /**
   * Send the command as soon as possible; a newer command replaces a waiting one.
   *
   * @param {Record<string, Value>} args
   */
  newest(args) {
    if (!this.isReady || this.isOver) return;
    this.next = args;
    this.goOn();
  }

  goOn() {
    if (this.isPending || this.next === null || this.pacing !== undefined) return;
    const waitMs = this.givenMs + this.everyMs - performance.now();
    if (waitMs > 0) {
      this.pacing = window.setTimeout(() => {
        this.pacing = undefined;
        this.goOn();
      }, waitMs);
      return;
    }
    const args = this.next;
    this.next = null;
    void this.once(args).then(() => this.goOn());
  }

  /**
   * @param {Phase} phase
   * @param {string} outcome
   * @param {number} forMs display time; 0 shows it until the next change
   */
  become(phase, outcome = "", forMs = 0) {
    if (this.isOver) return;
    clearTimeout(this.telling);
    this.phase = phase;
    this.outcome = outcome;
    if (forMs > 0) this.telling = window.setTimeout(() => this.become(""), forMs);
    this.show();
  }

  /**
   * Return the note below the control.
   *
   * @param {...string} more
   */
  note(...more) {
    const why = this.reason || this.notice;
    const hindrance = why ? `◆ ${why}` : "";
    return [this.outcome, hindrance, ...more].filter(Boolean).join(" · ");
  }
}
