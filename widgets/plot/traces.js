// @ts-check
/**
 * The latest readings of several signals, and the range of their drawing. Pure.
 */

/** Time span of a plot without readings, in seconds. */
const FIRST_SPAN_S = 10;

/** Readings of one signal: the newest `size`, oldest first. A gap is NaN. */
export class Ring {
  /** @param {number} size */
  constructor(size) {
    this.times = new Float64Array(size);
    this.values = new Float64Array(size);
    /** Number of readings so far; the newest is number `count - 1`. */
    this.count = 0;
  }

  /** Number of the oldest kept reading. */
  get first() {
    return Math.max(0, this.count - this.times.length);
  }

  /** @param {number} number */
  time(number) {
    return this.times[number % this.times.length] ?? NaN;
  }

  /** @param {number} number */
  value(number) {
    return this.values[number % this.values.length] ?? NaN;
  }

  /**
   * @param {number} time in seconds
   * @param {number} value NaN starts a gap
   */
  push(time, value) {
    const place = this.count % this.times.length;
    this.times[place] = time;
    this.values[place] = value;
    this.count += 1;
  }

  /**
   * Add a reading, after a gap if readings were missed. Readings out of order are dropped.
   *
   * @param {number} time in seconds
   * @param {number} value
   * @param {number} patience seconds after which two readings are not connected; 0: never
   */
  add(time, value, patience) {
    if (this.count > 0) {
      const last = this.time(this.count - 1);
      if (time <= last) return;
      if (patience > 0 && time - last > patience) this.cut();
    }
    this.push(time, value);
  }

  /** Start a gap after the last reading. */
  cut() {
    if (this.count === 0 || Number.isNaN(this.value(this.count - 1))) return;
    this.push(this.time(this.count - 1) + 1e-4, NaN);
  }

  /**
   * Return the number of the first reading at or after a time. The drawn line starts at the reading
   * before it.
   *
   * @param {number} time in seconds
   */
  since(time) {
    let [low, high] = [this.first, this.count];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < time) low = middle + 1;
      else high = middle;
    }
    return Math.max(this.first, low - 1);
  }
}

/**
 * Return the lowest and the highest value since a time; [Infinity, -Infinity] without values.
 *
 * @param {readonly Ring[]} rings
 * @param {number} time in seconds
 * @returns {[number, number]}
 */
export function extent(rings, time) {
  let [least, most] = [Infinity, -Infinity];
  for (const ring of rings) {
    for (let number = ring.since(time); number < ring.count; number += 1) {
      const value = ring.value(number);
      if (value < least) least = value;
      if (value > most) most = value;
    }
  }
  return [least, most];
}

/**
 * Return readings as rows of one table, one column for each signal; null for a missing value.
 *
 * @param {readonly Ring[]} rings
 * @param {number} from in seconds
 * @param {number} to in seconds
 * @returns {{times: number[], columns: (number | null)[][]}}
 */
export function table(rings, from, to) {
  const times = new Set();
  for (const ring of rings) {
    for (let number = ring.since(from); number < ring.count; number += 1) {
      const time = ring.time(number);
      if (time >= from && time <= to) times.add(time);
    }
  }
  const rows = [...times].sort((one, other) => one - other);
  const columns = rings.map((ring) => {
    const known = new Map();
    for (let number = ring.since(from); number < ring.count; number += 1) {
      const value = ring.value(number);
      known.set(ring.time(number), Number.isNaN(value) ? null : value);
    }
    return rows.map((time) => (known.has(time) ? known.get(time) : undefined));
  });
  return { times: rows, columns };
}

/**
 * Return a table as CSV (RFC 4180), with times in ISO 8601 format.
 *
 * @param {readonly string[]} names names of the columns
 * @param {{times: number[], columns: (number | null | undefined)[][]}} rows
 * @param {number} epoch milliseconds since 1970 at time 0
 */
export function csv(names, { times, columns }, epoch) {
  const lines = [["time", ...names].map(quoted).join(",")];
  times.forEach((time, row) => {
    const cells = columns.map((column) => column[row] ?? "");
    if (cells.every((cell) => cell === "")) return; // a gap
    lines.push([new Date(epoch + time * 1000).toISOString(), ...cells].join(","));
  });
  return `${lines.join("\r\n")}\r\n`;
}

/** @param {string} text */
function quoted(text) {
  // Neutralises text that a spreadsheet would treat as a formula.
  const safe = /^[=+\-@\t]/.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

/**
 * @param {unknown} text such as "60s" or "5min"
 * @returns {number} seconds
 */
export function seconds(text) {
  const match = /^(\d+)(s|min)$/.exec(String(text));
  return match ? Number(match[1]) * (match[2] === "min" ? 60 : 1) : 60;
}

/**
 * Return the shown time span: as long as the readings need, doubled from 10 s up to the window.
 *
 * @param {number} ageS age of the oldest reading, in seconds; 0 without readings
 * @param {number} windowS longest time span
 * @returns {number} seconds
 */
export function spanFor(ageS, windowS) {
  let span = FIRST_SPAN_S;
  while (span < ageS) span *= 2;
  return Math.min(span, windowS);
}
