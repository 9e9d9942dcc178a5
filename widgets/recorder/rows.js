// @ts-check
/**
 * What was recorded, and how it is written as a table (RFC 4180). Knows no page.
 *
 * @typedef {import("../../urc/web/static/types.js").Reading} Reading
 * @typedef {readonly [number, string, string]} Row Milliseconds since 1970, signal, value.
 */

/** A text that a spreadsheet would take for a formula. */
const FORMULA = /^[=+\-@\t\r]/;
const NUMBER = /^[+-]?[\d.]+(e[+-]?\d+)?$/i;

export class Recording {
  /** @param {number} most rows */
  constructor(most) {
    this.most = most;
    /** @type {Row[]} */
    this.rows = [];
    /** The last reading of each signal that was kept or passed over. @type {Map<string, number>} */
    this.serials = new Map();
  }

  get isFull() {
    return this.rows.length >= this.most;
  }

  /**
   * Pass over what was said before the recording began.
   *
   * @param {readonly Reading[]} readings
   */
  skip(readings) {
    for (const { signal, serial } of readings) this.serials.set(signal.name, serial);
  }

  /**
   * Keep each reading that is new, and return whether there was one.
   *
   * @param {readonly Reading[]} readings
   * @param {number} nowS the page's clock, in seconds
   * @param {number} dateMs the same moment, in milliseconds since 1970
   */
  add(readings, nowS, dateMs) {
    const before = this.rows.length;
    for (const { signal, serial, value, time } of readings) {
      if (this.serials.get(signal.name) === serial || this.isFull) continue;
      this.serials.set(signal.name, serial);
      if (value === null) continue;
      this.rows.push([Math.round(dateMs - (nowS - time) * 1000), signal.name, String(value)]);
    }
    return this.rows.length > before;
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
