// @ts-check
/**
 * The recorded rows, and their table (RFC 4180). Independent of the page.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Reading} Reading
 * @typedef {readonly [number, string, string]} Row Milliseconds since 1970, signal, value.
 */

/** Text that a spreadsheet would treat as a formula. */
const FORMULA = /^[=+\-@\t\r]/;
const NUMBER = /^[+-]?[\d.]+(e[+-]?\d+)?$/i;

export class Recording {
  /**
   * @param {number} most largest number of rows
   * @param {number} begunS start of the recording, by the page's clock
   */
  constructor(most, begunS) {
    this.most = most;
    this.begunS = begunS;
    /** @type {Row[]} */
    this.rows = [];
    /** Number of readings lost before the page. */
    this.lost = 0;
  }

  get isFull() {
    return this.rows.length >= this.most;
  }

  /**
   * Add a reading, unless it is older than the recording.
   *
   * @param {Reading} reading
   * @param {number} missed number of lost readings before it
   * @param {number} nowS the page's clock, in seconds
   * @param {number} dateMs the same moment, in milliseconds since 1970
   */
  add({ signal, value, time }, missed, nowS, dateMs) {
    if (this.isFull || time < this.begunS) return;
    this.lost += missed;
    if (value === null) return;
    this.rows.push([Math.round(dateMs - (nowS - time) * 1000), signal.name, String(value)]);
  }

  /** Return all rows as a table, in order of time. */
  table() {
    const rows = [...this.rows].sort((one, other) => one[0] - other[0]);
    const lines = rows.map(([time, name, value]) => [new Date(time).toISOString(), name, value].map(field).join(","));
    return ["time,signal,value", ...lines, ""].join("\r\n");
  }
}

/**
 * Return a quoted field, so that a robot's text does not become another field or a formula.
 *
 * @param {string} text
 */
export function field(text) {
  const safe = FORMULA.test(text) && !NUMBER.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

/**
 * Return a time span as text, such as "1:05" or "1:00:05".
 *
 * @param {number} seconds
 */
export function span(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  const two = (/** @type {number} */ value) => String(value).padStart(2, "0");
  return hours > 0 ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}
