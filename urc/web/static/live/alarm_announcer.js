// @ts-check
/**
 * Announces once to a screen reader that a value exceeds a limit, without repeats for new values.
 *
 * @typedef {import("../core/types.js").Alarm} Alarm
 * @typedef {import("./store.js").Store} Store
 */

import { t } from "../core/words.js";

/** @type {Record<Alarm, string>} */
const WORDS = { "": "", lolo: t("very low"), low: t("low"), high: t("high"), hihi: t("very high") };

export class AlarmAnnouncer {
  /** @param {HTMLElement} el an element with role alert */
  constructor(el) {
    this.el = el;
    /** @type {Map<string, Alarm>} */
    this.told = new Map();
    /** Whether any value exceeded a limit at the last check. */
    this.isAny = false;
  }

  /**
   * @param {Store} store
   * @param {number} nowMs
   */
  frame(store, nowMs) {
    this.isAny = false;
    for (const [name, sample] of store.samples) {
      if (sample.alarm) this.isAny = true;
      const before = this.told.get(name) ?? "";
      if (before === sample.alarm) continue;
      this.told.set(name, sample.alarm);
      if (!sample.alarm) continue;
      const { signal, text, unit } = store.reading(name, nowMs);
      this.el.textContent = `${signal.title || name} ${WORDS[sample.alarm]}: ${text} ${unit}`.trim();
    }
  }
}
