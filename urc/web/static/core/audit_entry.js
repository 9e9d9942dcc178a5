// @ts-check
/**
 * Audit log entries as text. The module uses no DOM.
 *
 * @typedef {object} Entry
 * @property {number} id
 * @property {number} at UTC in seconds
 * @property {string} robot
 * @property {string} what
 * @property {string} who
 * @property {string} role
 * @property {string} client
 * @property {number} epoch
 * @property {string} command
 * @property {string} arguments JSON
 * @property {string} data hex, or a size and a hash
 * @property {string} outcome
 * @property {number} times
 * @property {number} lasted_s
 * @property {string} principal
 * @property {string} kind
 * @property {string} way
 * @property {string} place
 */
import { mark } from "./words.js";

/**
 * Shape and word of each kind, because colour alone is not enough.
 *
 * @type {Readonly<Record<string, string>>}
 */
const SIGNS = {
  moved: mark("● moved"),
  stopped: mark("■ stopped"),
  refused: mark("▲ refused"),
  lease: mark("◆ controls"),
  override: mark("▲ override"),
  STOP: mark("■ STOP"),
  reset: mark("◆ reset"),
  ran: mark("→ command"),
  alarm: mark("◆ alarm"),
  lost: mark("▲ lost"),
  pruned: mark("○ old entries"),
  visit: mark("→ visit"),
  "signed in": mark("● signed in"),
  "sign-in failed": mark("▲ sign-in failed"),
  "signed out": mark("○ signed out"),
  revoked: mark("■ revoked"),
  pairing: mark("◆ pairing"),
  access: mark("◆ people"),
  settings: mark("◆ settings"),
  package: mark("◆ package"),
  recording: mark("● recording"),
  audit: mark("○ audit log"),
  server: mark("○ server"),
  clock: mark("▲ clock"),
};
/** @type {Readonly<Record<string, "warning" | "error">>} */
const LEVELS = { refused: "warning", override: "warning", "sign-in failed": "warning", clock: "warning", lost: "error", STOP: "error" };

/** @param {string} what @returns {string} an English text for `t` */
export function signOf(what) {
  return Object.hasOwn(SIGNS, what) ? (SIGNS[what] ?? what) : what;
}

/** @param {string} what @returns {"warning" | "error" | undefined} */
export function levelOf(what) {
  return Object.hasOwn(LEVELS, what) ? LEVELS[what] : undefined;
}

/** @param {Entry} entry @returns {string[]} command with arguments, outcome, count and duration */
export function detailsOf({ command, arguments: given, outcome, times, lasted_s }) {
  const count = times > 1 ? `×\u00a0${times}` : "";
  const lasted = lasted_s > 0 ? `${lasted_s}\u00a0s` : "";
  return [command, argumentsText(given), outcome, count, lasted].filter(Boolean);
}

/**
 * Return arguments without JSON punctuation; a shortened text is not valid JSON and stays
 * unchanged.
 *
 * @param {string} given
 */
function argumentsText(given) {
  try {
    const found = JSON.parse(given || "{}");
    return Object.entries(found).map(([name, value]) => `${name}: ${plain(value)}`).join(", ");
  } catch {
    return given;
  }
}

/** @param {unknown} value @returns {string} */
function plain(value) {
  if (Array.isArray(value)) return value.map(plain).join(" ");
  return typeof value === "string" ? value : JSON.stringify(value);
}

/** @param {number} at UTC in seconds @returns {[string, string]} local day and time */
export function timeOf(at) {
  const time = new Date(at * 1000);
  const day = `${time.getFullYear()}-${two(time.getMonth() + 1)}-${two(time.getDate())}`;
  return [day, `${two(time.getHours())}:${two(time.getMinutes())}:${two(time.getSeconds())}`];
}

/** @param {number} number */
function two(number) {
  return String(number).padStart(2, "0");
}
