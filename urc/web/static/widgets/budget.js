// @ts-check
/**
 * How much of the page's time a widget takes, and what it may still have. Knows no DOM.
 *
 * A page draws sixty times a second for all its widgets together. One that again and again takes
 * the time of several frames is called once a second only; if even that call takes too long, it is
 * ended. A call that never returns cannot be cut from inside the page: motion then ends by the
 * server's lease.
 */

/** A call that takes longer has cost the page frames. */
export const LONG_MS = 50;
const CALLS_SEEN = 60;
/** So many long ones of those make it slow. */
const LONG_CALLS = 20;
const SLOW_EVERY_MS = 1000;
/** Called once a second, it may still not stop the page for so long … */
const ENDLESS_MS = 500;
/** … so often. */
const ENDLESS_CALLS = 10;

export class Budget {
  constructor() {
    /** Whether each of the last calls was long. @type {boolean[]} */
    this.calls = [];
    this.longCalls = 0;
    this.endlessCalls = 0;
    this.isSlow = false;
    this.lastMs = -Infinity;
  }

  /**
   * Whether it may be called now.
   *
   * @param {number} nowMs
   */
  allows(nowMs) {
    return !this.isSlow || nowMs - this.lastMs >= SLOW_EVERY_MS;
  }

  /** Whether it has to end: even once a second it stops the page. */
  get isSpent() {
    return this.endlessCalls >= ENDLESS_CALLS;
  }

  /**
   * Count one call.
   *
   * @param {number} nowMs when it began
   * @param {number} tookMs
   */
  count(nowMs, tookMs) {
    this.lastMs = nowMs;
    const isLong = tookMs > LONG_MS;
    this.calls.push(isLong);
    if (isLong) this.longCalls += 1;
    if (this.calls.length > CALLS_SEEN && this.calls.shift()) this.longCalls -= 1;
    if (this.longCalls >= LONG_CALLS) this.isSlow = true;
    // A minute without a long call: whatever it was is over.
    if (this.isSlow && this.calls.length >= CALLS_SEEN && this.longCalls === 0) this.isSlow = false;
    if (this.isSlow && tookMs > ENDLESS_MS) this.endlessCalls += 1;
  }
}
