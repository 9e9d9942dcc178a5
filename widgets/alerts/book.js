// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Alert} Alert */

/**
 * What people have done about alerts. An alert that is over is forgotten, so that the next one of
 * the same value is new; one that gets worse is new, too. No DOM, no clock.
 *
 * @typedef {{alarm: string, isSeen: boolean, untilMs: number}} Entry
 */
export class Book {
  /** @param {unknown} kept as `kept()` returned it */
  constructor(kept) {
    /** @type {Map<string, Entry>} */
    this.entries = new Map();
    if (!Array.isArray(kept)) return;
    for (const [signal, alarm, isSeen, untilMs] of kept.filter(Array.isArray)) {
      this.entries.set(String(signal), { alarm: String(alarm), isSeen: isSeen === true, untilMs: Number(untilMs) || 0 });
    }
  }

  kept() {
    return [...this.entries].map(([signal, { alarm, isSeen, untilMs }]) => [signal, alarm, isSeen, untilMs]);
  }

  /**
   * @param {readonly Alert[]} alerts all there are now
   * @param {number} nowMs of the day
   * @returns {Alert[]} those that are new
   */
  take(alerts, nowMs) {
    const there = new Set(alerts.map(({ signal }) => signal));
    for (const signal of this.entries.keys()) {
      if (!there.has(signal)) this.entries.delete(signal);
    }
    return alerts.filter(({ signal, alarm }) => {
      const known = this.entries.get(signal);
      if (known && known.alarm === alarm) {
        if (known.untilMs === 0 || known.untilMs > nowMs) return false;
        known.untilMs = 0; // it was put off, and its time is over
        known.isSeen = false;
        return true;
      }
      const isWorse = known === undefined || (isCritical(alarm) && !isCritical(known.alarm));
      this.entries.set(signal, {
        alarm,
        isSeen: isWorse ? false : known.isSeen,
        untilMs: isWorse ? 0 : known.untilMs,
      });
      return isWorse;
    });
  }

  /** @param {string} signal */
  acknowledge(signal) {
    const entry = this.entries.get(signal);
    if (entry) entry.isSeen = true;
  }

  /**
   * @param {string} signal
   * @param {number} untilMs of the day
   */
  shelve(signal, untilMs) {
    const entry = this.entries.get(signal);
    if (entry) entry.untilMs = untilMs;
  }

  /**
   * @param {string} signal
   * @param {number} nowMs
   * @returns {"new" | "seen" | "shelved"}
   */
  state(signal, nowMs) {
    const entry = this.entries.get(signal);
    if (!entry) return "new";
    if (entry.untilMs > nowMs) return "shelved";
    return entry.isSeen ? "seen" : "new";
  }

  /** @param {string} signal */
  untilMs(signal) {
    return this.entries.get(signal)?.untilMs ?? 0;
  }
}

/** @param {string} alarm */
function isCritical(alarm) {
  return alarm === "lolo" || alarm === "hihi";
}
