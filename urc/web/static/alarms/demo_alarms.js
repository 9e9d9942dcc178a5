// @ts-check
/**
 * The alarms of a demo. The page derives alarms from the readings, in place of the server.
 *
 * @typedef {import("../core/types.js").Alert} Alert
 * @typedef {import("../live/store.js").Store} Store
 *
 * @typedef {object} AlarmDoor Actions of an operator on alarms.
 * @property {boolean} mayAct
 * @property {(rows: readonly Pick<Alert, "signal" | "raised">[]) => unknown} acknowledge
 * @property {(signals: string[], minutes: number) => void} shelve
 * @property {() => void} open
 */

/** @type {readonly string[]} */
const GRAVE = ["lolo", "hihi", "major"];

export class DemoAlarms {
  /**
   * @param {Store} store
   * @param {readonly Partial<Alert>[] | undefined} given alarms of the demo; by default, they
   *   follow from the readings
   * @param {(text: string) => void} say
   * @param {() => void} wake
   */
  constructor(store, given, say, wake) {
    this.store = store;
    this.given = given;
    this.say = say;
    this.wake = wake;
    this.mayAct = true;
    /** @type {Map<string, Pick<Alert, "state" | "leftS" | "who">>} */
    this.deeds = new Map();
  }

  /** @param {readonly Pick<Alert, "signal">[]} rows */
  acknowledge(rows) {
    for (const { signal } of rows) this.deeds.set(signal, { state: "acknowledged", leftS: 0, who: "This page" });
    this.say(`acknowledge ${rows.map(({ signal }) => signal).join(" ")}`);
    this.wake();
  }

  /**
   * @param {string[]} signals
   * @param {number} minutes
   */
  shelve(signals, minutes) {
    for (const signal of signals) this.deeds.set(signal, { state: "shelved", leftS: 60 * minutes, who: "This page" });
    this.say(`shelve ${signals.join(" ")} for ${minutes} min`);
    this.wake();
  }

  open() {
    this.say("open the list of alarms");
  }

  news() {
    const nowMs = performance.now();
    const found = this.given ?? this.judged(nowMs);
    const value = found.map((alert, place) => this.whole(alert, place));
    return { look: JSON.stringify(value), value };
  }

  /**
   * @param {number} nowMs
   * @returns {Partial<Alert>[]}
   */
  judged(nowMs) {
    const found = [];
    for (const name of this.store.samples.keys()) {
      const { alarm, text, unit, age, signal } = this.store.reading(name, nowMs);
      if (alarm) found.push({ signal: name, title: signal.title || name, alarm, text, unit, age });
    }
    return found.sort((one, other) => Number(GRAVE.includes(other.alarm)) - Number(GRAVE.includes(one.alarm)));
  }

  /**
   * @param {Partial<Alert>} alert
   * @param {number} place
   * @returns {Alert}
   */
  whole(alert, place) {
    const alarm = alert.alarm ?? "low";
    return {
      signal: "", title: "", text: "", unit: "", age: "", since: 0, condition: alarm,
      priority: GRAVE.includes(alarm) ? "high" : "medium", state: "unacknowledged", isActive: true,
      isKnown: !alert.age, raised: place + 1, number: place + 1, times: 1, cause: "", action: "", who: "", leftS: 0,
      ...alert, alarm, ...this.deeds.get(alert.signal ?? ""),
    };
  }
}
