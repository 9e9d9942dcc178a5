// @ts-check
/**
 * A robot's state in words, for its card. The module uses no DOM.
 *
 * @typedef {object} Battery
 * @property {number} value
 * @property {string} unit
 * @property {string} alarm exceeded limit; "" if normal
 *
 * @typedef {object} Summary A robot in the response of `/api/v1/robots`.
 * @property {string} name
 * @property {"idle" | "connecting" | "live" | "silent" | "lost"} state
 * @property {boolean} connected whether a page or program uses the robot
 * @property {string} holder
 * @property {string} latched
 * @property {boolean} confirmed whether the robot has confirmed its last stop
 * @property {boolean} can_stop whether STOP ALL includes the robot
 * @property {Battery | null} battery
 * @property {{count: number, worst: "" | "low" | "medium" | "high"}} alarms
 * @property {number | null} seen_at in seconds since 1970
 *
 * @typedef {{words: string, tone: "" | "caution" | "bad"}} Said
 * @typedef {"confirmed" | "latched" | "no-link" | "refused"} Result of STOP for one robot
 */
import { SIGNS } from "../core/alarm_signs.js";
import { ageText } from "../core/formatting.js";
import { said, t } from "../core/words.js";

const DAY_S = 24 * 3600;
/** Maximum age that is shown in hours, in seconds. */
const LONGEST_HOURS_S = 48 * 3600;

/**
 * Return the state of the connection.
 *
 * @param {Summary} robot
 * @param {number} nowS the server's time, in seconds since 1970
 * @returns {Said & {state: string}} without words before the first connection
 */
export function linkWords(robot, nowS) {
  if (!robot.connected) return { state: "off", words: awayWords(robot.seen_at, nowS), tone: "" };
  switch (robot.state) {
    case "live":
      return { state: "live", words: `● ${t("Live")}`, tone: "" };
    case "silent":
      return { state: "silent", words: `◆ ${t("Silent")}`, tone: "caution" };
    case "lost":
      return { state: "lost", words: `▲ ${t("Not reached")}`, tone: "bad" };
    default:
      return { state: "connecting", words: `◌ ${t("Connecting")}`, tone: "" };
  }
}

/**
 * @param {number | null} seenAt
 * @param {number} nowS
 */
function awayWords(seenAt, nowS) {
  if (seenAt === null) return ""; // the card then shows what the robot is
  const ageS = Math.max(0, nowS - seenAt);
  if (ageS < 60) return `○ ${t("Last seen just now")}`;
  const age = ageS > LONGEST_HOURS_S ? t("{n} days", { n: Math.floor(ageS / DAY_S) }) : ageText(ageS);
  return `○ ${t("Last seen {age} ago", { age })}`;
}

/**
 * @param {Summary} robot
 * @returns {Said | null} null without a known battery
 */
export function batteryWords({ battery }) {
  if (!battery) return null;
  const figure = `${battery.value} ${battery.unit}`;
  const isBad = battery.alarm === "lolo" || battery.alarm === "hihi";
  return { words: t("Battery {figure}", { figure }), tone: isBad ? "bad" : battery.alarm ? "caution" : "" };
}

/**
 * Return the name of the operator who drives or has stopped the robot.
 *
 * @param {Summary} robot
 * @param {Result} [result] result of this page's last STOP for the robot
 * @returns {Said | null}
 */
export function whoWords({ holder, latched, confirmed }, result) {
  if (result === "no-link") return { words: t("▲ NO LINK"), tone: "bad" };
  if (latched && confirmed) return { words: t("■ Stopped ✓ by {who}", { who: said(latched) }), tone: "bad" };
  if (result === "confirmed") return { words: t("■ Stopped ✓"), tone: "bad" };
  if (latched) return { words: t("■ Stopped by {who}", { who: said(latched) }), tone: "bad" };
  return holder ? { words: t("{who} is driving", { who: said(holder) }), tone: "" } : null;
}

/**
 * @param {Summary} robot
 * @returns {Said | null} null without an alarm
 */
export function alarmWords({ alarms: { count, worst } }) {
  if (count === 0) return null;
  const words = count === 1 ? t("1 alarm") : t("{n} alarms", { n: count });
  return { words: `${SIGNS[worst || "low"]} ${words}`, tone: worst === "high" ? "bad" : "caution" };
}
