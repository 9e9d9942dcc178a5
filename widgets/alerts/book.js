// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Alert} Alert */

/**
 * Acknowledged and shelved alerts. An ended alert is forgotten, so that the next one of the same value
 * is new; an alert that gets worse is new, too. It knows no DOM and no clock.
 *
 * @typedef {{alarm: string, isSeen: boolean, untilMs: number}} Entry
 */
export class Book {
  /** @param {unknown} kept earlier result of `kept()` */
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
   * @param {readonly Alert[]} alerts all present alerts
   * @param {number} nowMs time of day
   * @returns {Alert[]} the new ones
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
        known.untilMs = 0; // shelved, and the time is over
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
   * @param {number} untilMs time of day
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
