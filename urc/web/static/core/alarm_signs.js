// @ts-check
/**
 * The shape of an alarm, by its priority: the same shape in the strip, the list, the tiles, the menu and
 * the title of the page, because colour alone is not enough. The module uses no DOM.
 *
 * @typedef {import("./types.js").Alarm} Alarm
 * @typedef {import("./types.js").AlarmPriority} AlarmPriority
 * @typedef {import("./types.js").Held} Held
 * @typedef {import("./types.js").Signal} Signal
 */

/** Shape of each priority: fewer corners or less ink for less urgency. ■ is a latched STOP. */
export const SIGNS = Object.freeze({ high: "▲", medium: "◆", low: "◇" });

/** @type {readonly Alarm[]} */
const GRAVE = ["lolo", "hihi", "major"];

/**
 * Return the priority that an alarm has without a declaration.
 *
 * @param {Alarm} alarm
 * @returns {AlarmPriority}
 */
export function usualPriority(alarm) {
  return GRAVE.includes(alarm) ? "high" : "medium";
}

/**
 * Return the priority of a sample's alarm, as the server's list of alarms has it.
 *
 * @param {Alarm} alarm
 * @param {Held} value value of the sample
 * @param {Pick<Signal, "priorities">} signal
 * @returns {AlarmPriority | ""} "" without an alarm
 */
export function priorityOf(alarm, value, { priorities = {} }) {
  if (alarm === "") return "";
  if (alarm !== "minor") return (alarm === "major" ? undefined : priorities[alarm]) ?? usualPriority(alarm);
  const states = (Array.isArray(value) ? value : [value]).map(String);
  const state = states.find((one) => Object.hasOwn(priorities, one) && priorities[one] !== "high");
  return (state === undefined ? undefined : priorities[state]) ?? usualPriority(alarm);
}
