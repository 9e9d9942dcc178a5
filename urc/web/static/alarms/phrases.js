// @ts-check
/**
 * Texts of alarms: shape, word, value and state.
 *
 * @typedef {import("./book.js").AlarmRow} AlarmRow
 * @typedef {import("../live/store.js").Store} Store
 */
import { ageText } from "../core/formatting.js";
import { mark, t } from "../core/words.js";
import { ALARMS } from "../widgets/kit.js";
import { levelOf } from "./book.js";

/**
 * Return the number of alarms that are not shown, as text; "" without any.
 *
 * @param {number} count
 */
export function moreAlarms(count) {
  if (count < 1) return "";
  return count === 1 ? t("1 more alarm") : t("{count} more alarms", { count });
}

/** @type {Readonly<Record<string, string>>} */
export const STATES = Object.freeze({
  unacknowledged: mark("not acknowledged"),
  acknowledged: mark("acknowledged"),
  returned: mark("back to normal, not acknowledged"),
  shelved: mark("shelved"),
  suppressed: mark("suppressed by design"),
});
/** @type {Readonly<Record<string, string>>} */
export const PRIORITIES = Object.freeze({
  high: mark("high priority"),
  medium: mark("medium priority"),
  low: mark("low priority"),
});
/** @type {Readonly<Record<string, string>>} */
export const EVENTS = Object.freeze({
  raised: mark("raised"),
  changed: mark("eased"),
  returned: mark("back to normal"),
  acknowledged: mark("acknowledged"),
  shelved: mark("shelved"),
  unshelved: mark("no longer shelved"),
  suppressed: mark("suppressed by design"),
  unsuppressed: mark("no longer suppressed"),
  unknown: mark("value unknown"),
  removed: mark("removed from the document"),
  "flood began": mark("alarm flood began"),
  "flood ended": mark("alarm flood ended"),
});

/**
 * Return the words of a limit or an alarm state, without a shape.
 *
 * @param {string} condition
 */
export function conditionText(condition) {
  const known = /** @type {Record<string, string>} */ (ALARMS)[condition];
  return known ? t(known) : stateWords(condition);
}

/**
 * Return an alarm state as words, because many robots use names such as PROTECTIVE_STOP.
 *
 * @param {string} state
 */
export function stateWords(state) {
  return /^[A-Z][A-Z0-9_]+$/.test(state) ? state.toLowerCase().replaceAll("_", " ") : state;
}

/**
 * @param {AlarmRow} row
 * @param {Store} store
 */
export function titleOf(row, store) {
  return store.signals.get(row.signal)?.title || row.title || row.signal;
}

/**
 * Return the present value with its unit and age, or the value at the last change.
 *
 * @param {AlarmRow} row
 * @param {Store} store
 * @param {number} nowMs on the page's clock
 * @param {boolean} [hasAge] whether the text includes the age of a stale value
 */
export function valueText(row, store, nowMs, hasAge = true) {
  const level = levelOf(row);
  const { text, unit, state, age } = store.reading(row.signal, nowMs);
  const isShown = state === "live" || state === "stale";
  if (!row.known && !isShown) return t("value unknown");
  // An alarm state is also the value.
  if (level === "major" || level === "minor") return isShown && !row.active ? text : "";
  if (!isShown) return row.value;
  const value = unit ? `${text} ${unit}` : text;
  return age && hasAge ? `${value} · ${t("{age} old", { age })}` : value;
}

/**
 * Return one line: title, condition, value.
 *
 * @param {AlarmRow} row
 * @param {Store} store
 * @param {number} nowMs
 * @param {boolean} [hasAge]
 */
export function lineOf(row, store, nowMs, hasAge = true) {
  const value = valueText(row, store, nowMs, hasAge);
  const words = `${titleOf(row, store)}: ${conditionText(row.condition)}`;
  return value ? `${words}, ${value}` : words;
}

/**
 * Return the time left until an end on the server's clock.
 *
 * @param {number} untilMs
 * @param {number} nowMs on the server's clock
 */
export function leftText(untilMs, nowMs) {
  return ageText(Math.max(0, untilMs - nowMs) / 1000);
}
