// @ts-check
/**
 * The share of the page's time that a widget may use. The module uses no DOM.
 *
 * A page draws sixty times a second for all its widgets together. A widget that often needs the
 * time of several frames is called only once a second. If even that call takes too long, the widget
 * is ended. The page cannot interrupt a call that never returns. In that case, the server's lease
 * ends all motion.
 */

/** Duration of a call that costs frames of the page. */
export const LONG_MS = 50;
const CALLS_SEEN = 60;
/** Number of long calls among these at which a widget counts as slow. */
const LONG_CALLS = 20;
const SLOW_EVERY_MS = 1000;
/** Duration above which a slow widget's call blocks the page. */
const ENDLESS_MS = 500;
/** Number of blocking calls after which the widget is ended. */
const ENDLESS_CALLS = 10;

export class RenderBudget {
  constructor() {
    /** Whether each of the last calls was long. @type {boolean[]} */
    this.calls = [];
    this.longCalls = 0;
    this.endlessCalls = 0;
    this.isSlow = false;
    this.lastMs = -Infinity;
  }

  /**
   * Return whether the widget may be called now.
   *
   * @param {number} nowMs
   */
  allows(nowMs) {
    return !this.isSlow || nowMs - this.lastMs >= SLOW_EVERY_MS;
  }

  /** Whether the widget must end, because it blocks the page even when called once a second. */
  get isSpent() {
    return this.endlessCalls >= ENDLESS_CALLS;
  }

  /**
   * Count one call of the widget.
   *
   * @param {number} nowMs start of the call
   * @param {number} tookMs
   */
  count(nowMs, tookMs) {
    this.lastMs = nowMs;
    const isLong = tookMs > LONG_MS;
    this.calls.push(isLong);
    if (isLong) this.longCalls += 1;
    if (this.calls.length > CALLS_SEEN && this.calls.shift()) this.longCalls -= 1;
    if (this.longCalls >= LONG_CALLS) this.isSlow = true;
    // After a minute without a long call, the cause has ended.
    if (this.isSlow && this.calls.length >= CALLS_SEEN && this.longCalls === 0) this.isSlow = false;
    if (this.isSlow && tookMs > ENDLESS_MS) this.endlessCalls += 1;
  }
}
