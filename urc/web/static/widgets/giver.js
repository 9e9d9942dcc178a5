// @ts-check
/**
 * One command that a widget gives, and what became of it. Knows no socket and no store.
 *
 * @typedef {import("../core/types.js").Outlet} Outlet
 * @typedef {import("../core/types.js").StopState} StopState
 * @typedef {import("../core/types.js").Value} Value
 * @typedef {(text: string, names?: Record<string, string | number>) => string} T
 * @typedef {"" | "pending" | "done" | "failed"} Phase
 */

/** How long what was done is told. */
const TELL_MS = 4000;

/** One command: given, under way, done or failed. What it shows is what became of it. */
export class Giver {
  /**
   * @param {object} spec
   * @param {(args: Record<string, Value>) => Promise<unknown>} spec.give
   * @param {() => void} spec.show called when any of it has changed
   * @param {T} spec.t
   * @param {AbortSignal} spec.signal
   * @param {number} [spec.everyMs] `newest` gives no more often
   * @param {(listener: (state: StopState) => void) => void} [spec.onStop] by which `newest` learns of
   *   STOP: what still waits then is not given
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
    this.isAnswered = false;
    this.isOver = false;
    /** What is to be given next. @type {Record<string, Value> | null} */
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

  /** @param {Outlet | undefined} outlet as `update` was given it */
  take(outlet) {
    this.reason = outlet ? outlet.reason : this.t("no command is bound to it");
    this.isAnswered = outlet?.isAnswered ?? false;
    if (this.reason) this.next = null; // what could not be given is not given later
    this.show();
  }

  /**
   * Give it, unless it is under way already.
   *
   * @param {Record<string, Value>} [args]
   * @returns {Promise<boolean>} whether it was done
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
   * Give it as soon as may be; a newer one takes the place of one that still waits.
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
   * @param {number} forMs 0: until something happens
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
   * What is to be read below the control.
   *
   * @param {...string} more
   */
  note(...more) {
    const hindrance = this.reason ? `◆ ${this.reason}` : "";
    return [this.outcome, hindrance, ...more].filter(Boolean).join(" · ");
  }
}
