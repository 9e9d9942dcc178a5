// @ts-check
/**
 * What was recorded, and how it is written as a table (RFC 4180). Knows no page.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Reading} Reading
 * @typedef {readonly [number, string, string]} Row Milliseconds since 1970, signal, value.
 */

/** A text that a spreadsheet would take for a formula. */
const FORMULA = /^[=+\-@\t\r]/;
const NUMBER = /^[+-]?[\d.]+(e[+-]?\d+)?$/i;

export class Recording {
  /**
   * @param {number} most rows
   * @param {number} begunS when it began, by the page's clock
   */
  constructor(most, begunS) {
    this.most = most;
    this.begunS = begunS;
    /** @type {Row[]} */
    this.rows = [];
    /** Readings that never reached the page. */
    this.lost = 0;
  }

  get isFull() {
    return this.rows.length >= this.most;
  }

  /**
   * Keep a reading, unless it is from before the recording.
   *
   * @param {Reading} reading
   * @param {number} missed how many were lost before it
   * @param {number} nowS the page's clock, in seconds
   * @param {number} dateMs the same moment, in milliseconds since 1970
   */
  add({ signal, value, time }, missed, nowS, dateMs) {
    if (this.isFull || time < this.begunS) return;
    this.lost += missed;
    if (value === null) return;
    this.rows.push([Math.round(dateMs - (nowS - time) * 1000), signal.name, String(value)]);
  }

  /** Return all as a table in the order of time. */
  table() {
    const rows = [...this.rows].sort((one, other) => one[0] - other[0]);
    const lines = rows.map(([time, name, value]) => [new Date(time).toISOString(), name, value].map(field).join(","));
    return ["time,signal,value", ...lines, ""].join("\r\n");
  }
}

/**
 * Return a field as it is written: a robot's text never becomes another field, nor a formula.
 *
 * @param {string} text
 */
export function field(text) {
  const safe = FORMULA.test(text) && !NUMBER.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

/**
 * Return a time span for people, as "1:05" or "1:00:05".
 *
 * @param {number} seconds
 */
export function span(seconds) {
  const whole = Math.max(0, Math.floor(seconds));
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  const two = (/** @type {number} */ value) => String(value).padStart(2, "0");
  return hours > 0 ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}
