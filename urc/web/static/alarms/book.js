// @ts-check
/**
 * The robot's alarms, as listed by the server. The module uses no DOM, socket or clock.
 *
 * @typedef {import("../core/types.js").Alarm} Alarm
 *
 * @typedef {"unacknowledged" | "acknowledged" | "returned" | "shelved" | "suppressed"} AlarmState
 * @typedef {"low" | "medium" | "high"} Priority
 *
 * @typedef {object} AlarmRow One alarm; times are in milliseconds since 1970 on the server's clock.
 * @property {string} signal
 * @property {string} condition Exceeded limit, or alarm state.
 * @property {Priority} priority
 * @property {AlarmState} state
 * @property {number} number Number of the activation; numbers increase in first-out order.
 * @property {number} group Number of the burst.
 * @property {number} raised Number of the alarm's last raise; an acknowledgement must repeat it.
 * @property {number} began
 * @property {string} value Value at the last change, as text.
 * @property {boolean} active
 * @property {boolean} known Whether the current value is known.
 * @property {number} times Number of activations.
 * @property {number} returned
 * @property {number} acknowledged
 * @property {string} acknowledged_by
 * @property {number} shelved_until
 * @property {string} shelved_by
 * @property {string} cause
 * @property {string} action
 * @property {string} command Command that carries out the action.
 * @property {string} title Title of the signal.
 *
 * @typedef {Partial<AlarmRow> & Pick<AlarmRow, "signal">} SentRow The server omits default values.
 *
 * @typedef {object} AlarmsMessage
 * @property {number} now
 * @property {SentRow[]} rows
 * @property {string[]} [gone]
 * @property {boolean} [full]
 * @property {boolean} [flood]
 *
 * @typedef {{active: number, unacknowledged: number, worst: Priority | ""}} AlarmCount
 */

/** @type {AlarmRow} */
const USUAL = {
  signal: "", condition: "", priority: "medium", state: "unacknowledged", number: 0, group: 0, raised: 0, began: 0,
  value: "", active: false, known: false, times: 1, returned: 0, acknowledged: 0, acknowledged_by: "",
  shelved_until: 0, shelved_by: "", cause: "", action: "", command: "", title: "",
};
/** @type {Priority[]} */
const PRIORITIES = ["high", "medium", "low"];
const LIMITS = new Set(["lolo", "low", "high", "hihi"]);
const MILD = new Set(["low", "high"]);

export class AlarmBook {
  constructor() {
    /** @type {Map<string, AlarmRow>} */
    this.rows = new Map();
    this.isFlooded = false;
    /** Offset from this device's clock to the server's clock, in milliseconds. */
    this.leadMs = 0;
    /** Increases with each change. */
    this.edition = 0;
    /** Last announced `raised` of each signal. @type {Map<string, number>} */
    this.announced = new Map();
  }

  /** Clear the list, because the next message contains all alarms. */
  clear() {
    this.rows.clear();
    this.isFlooded = false;
    this.edition += 1;
  }

  /**
   * @param {AlarmsMessage} message
   * @param {number} nowMs time of day of this device
   * @returns {AlarmRow[]} unacknowledged alarms that were not announced before
   */
  take(message, nowMs) {
    if (message.full) this.rows.clear();
    for (const signal of message.gone ?? []) this.rows.delete(signal);
    for (const row of message.rows) this.rows.set(row.signal, { ...USUAL, ...row });
    this.isFlooded = message.flood ?? false;
    this.leadMs = message.now - nowMs;
    this.edition += 1;
    const fresh = [...this.rows.values()].filter(
      ({ signal, state, raised }) => state === "unacknowledged" && this.announced.get(signal) !== raised,
    );
    for (const { signal, raised } of fresh) this.announced.set(signal, raised);
    return fresh.sort(byUrgency);
  }

  /** Annunciated alarms, most urgent first. */
  listed() {
    return [...this.rows.values()].filter(({ state }) => state !== "shelved" && state !== "suppressed").sort(byUrgency);
  }

  /** Return the priority of each annunciated active alarm, by its signal. */
  active() {
    return new Map(this.listed().filter(({ active }) => active).map(({ signal, priority }) => [signal, priority]));
  }

  /** Shelved and suppressed alarms. */
  hidden() {
    return [...this.rows.values()].filter(({ state }) => state === "shelved" || state === "suppressed").sort(byUrgency);
  }

  /** @returns {AlarmCount} */
  count() {
    const listed = this.listed();
    const worst = Math.min(...listed.map(({ priority }) => PRIORITIES.indexOf(priority)));
    return {
      active: listed.filter(({ active }) => active).length,
      unacknowledged: listed.filter(({ state }) => state !== "acknowledged").length,
      worst: PRIORITIES[worst] ?? "",
    };
  }
}

/**
 * Order by urgency: active, unacknowledged, priority, severity, then first-out.
 *
 * @param {AlarmRow} one
 * @param {AlarmRow} other
 */
export function byUrgency(one, other) {
  return (
    Number(other.active) - Number(one.active) ||
    Number(one.state === "acknowledged") - Number(other.state === "acknowledged") ||
    PRIORITIES.indexOf(one.priority) - PRIORITIES.indexOf(other.priority) ||
    Number(MILD.has(one.condition)) - Number(MILD.has(other.condition)) ||
    one.number - other.number
  );
}

/**
 * @param {AlarmRow} one
 * @param {AlarmRow} other
 */
export function byFirstOut(one, other) {
  return one.number - other.number;
}

/**
 * Return a row's alarm in the form of samples: the exceeded limit, or the severity of its state.
 *
 * @param {Pick<AlarmRow, "condition" | "priority">} row
 * @returns {Alarm}
 */
export function levelOf({ condition, priority }) {
  if (LIMITS.has(condition)) return /** @type {Alarm} */ (condition);
  return priority === "high" ? "major" : "minor";
}

/** Minimum number of alarms in a burst for grouping. */
const LEAST_GROUP = 3;

/**
 * Group the alarms of each burst during a flood; otherwise, return single alarms.
 *
 * @param {AlarmRow[]} rows sorted
 * @param {boolean} isFlooded
 * @returns {AlarmRow[][]} groups, in the order of their first row
 */
export function grouped(rows, isFlooded) {
  if (!isFlooded) return rows.map((row) => [row]);
  /** @type {Map<number, AlarmRow[]>} */
  const bursts = new Map();
  for (const row of rows) bursts.set(row.group, [...(bursts.get(row.group) ?? []), row]);
  return [...bursts.values()].flatMap((burst) =>
    burst.length < LEAST_GROUP ? burst.map((row) => [row]) : [burst],
  );
}
