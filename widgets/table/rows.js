// @ts-check
/**
 * Rows of values and of diagnostics, and their order. Pure.
 *
 * @typedef {"error" | "warn" | "stale" | "unknown" | "ok"} Level
 * @typedef {{name: string, level: Level, message: string, values?: [string, string][], age?: number}} Row
 */

/** Levels, worst first. @type {readonly Level[]} */
export const ORDER = ["error", "warn", "stale", "unknown", "ok"];
/** Levels by number, as in diagnostic_msgs/DiagnosticStatus. @type {readonly Level[]} */
const NUMBERS = ["ok", "warn", "error", "stale"];
/** @type {Record<string, Level>} */
const WORDS = {
  ok: "ok",
  info: "ok",
  good: "ok",
  warn: "warn",
  warning: "warn",
  caution: "warn",
  error: "error",
  fault: "error",
  fatal: "error",
  critical: "error",
  alarm: "error",
  stale: "stale",
};
export const MOST_ROWS = 500;
/** Largest number of values of one part. */
const MOST_VALUES = 100;

/**
 * @param {unknown} given a number as in ROS, or a word
 * @returns {Level} unknown for any other value
 */
export function levelOf(given) {
  if (typeof given === "number") return NUMBERS[given] ?? "unknown";
  const word = String(given ?? "").trim().toLowerCase();
  if (/^[0-3]$/.test(word)) return NUMBERS[Number(word)] ?? "unknown";
  return Object.hasOwn(WORDS, word) ? (WORDS[word] ?? "unknown") : "unknown";
}

/**
 * Return the rows of a report.
 *
 * @param {unknown} report `{status: [{level, name, message}]}`, `{name: {level, message}}`, or
 *   `{name: level}`
 * @returns {Row[]}
 */
export function rowsOf(report) {
  if (typeof report !== "object" || report === null) return [];
  const status = /** @type {Record<string, unknown>} */ (report)["status"];
  if (Array.isArray(status)) return status.slice(0, MOST_ROWS).map((each) => rowOf("", each));
  return Object.entries(report).slice(0, MOST_ROWS).map(([name, each]) => rowOf(name, each));
}

/**
 * @param {string} name
 * @param {unknown} given
 * @returns {Row}
 */
function rowOf(name, given) {
  if (typeof given !== "object" || given === null) {
    const level = levelOf(given);
    return { name, level, message: level === "unknown" ? text(given) : "" };
  }
  const { level, name: own, message, values } = /** @type {Record<string, unknown>} */ (given);
  const row = { name: text(own) || name, level: levelOf(level), message: text(message) };
  if (!Array.isArray(values) || values.length === 0) return row;
  return { ...row, values: values.slice(0, MOST_VALUES).map(pairOf) };
}

/**
 * Return the rows of three lists.
 *
 * @param {readonly unknown[]} levels
 * @param {readonly unknown[]} names
 * @param {readonly unknown[]} messages
 * @returns {Row[]}
 */
export function rowsOfLists(levels, names, messages) {
  const count = Math.min(MOST_ROWS, Math.max(levels.length, names.length));
  return Array.from({ length: count }, (_, place) => ({
    name: text(names[place]) || String(place + 1),
    level: levelOf(levels[place]),
    message: text(messages[place]),
  }));
}

/**
 * Return a diagnostic_msgs/KeyValue as a pair.
 *
 * @param {unknown} given
 * @returns {[string, string]}
 */
function pairOf(given) {
  const { key, value } = /** @type {Record<string, unknown>} */ (given ?? {});
  return [text(key), text(value)];
}

/** @param {unknown} value */
function text(value) {
  return value === null || value === undefined || typeof value === "object" ? "" : String(value);
}

/**
 * Return the visible rows, in order.
 *
 * @template {Row} T
 * @param {readonly T[]} rows
 * @param {{sort: unknown, least: unknown, filter: string}} wanted
 * @returns {T[]}
 */
export function shown(rows, { sort, least, filter }) {
  const needle = filter.trim().toLowerCase();
  const most = least === "error" ? 0 : least === "warn" ? ORDER.indexOf("unknown") : ORDER.length;
  const found = rows.filter(
    ({ name, level, message }) =>
      ORDER.indexOf(level) <= most && `${name} ${level} ${message}`.toLowerCase().includes(needle),
  );
  if (sort === "given") return found;
  return found.sort((one, other) => ORDER.indexOf(one.level) - ORDER.indexOf(other.level));
}
