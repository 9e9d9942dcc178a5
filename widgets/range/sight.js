// @ts-check
/**
 * The meaning and the drawing of a distance. Pure: no DOM.
 *
 * Angles are degrees from straight ahead, counter-clockwise as in REP 103; drawings have x to the right
 * and y down, so that ahead is up.
 *
 * @typedef {"in" | "clear" | "close" | "unknown"} Kind
 * @typedef {"" | "near" | "stop"} Zone
 *
 * @typedef {object} Bounds
 * @property {number | null} min
 * @property {number | null} max
 * @property {number | null} near
 * @property {number | null} stop
 */

/**
 * Return the kind of a distance by REP 117: above the range is clear (+Inf), below the range is too close
 * (-Inf), and NaN is unknown. Most formats have no infinity, so the ends of the range count as outside.
 *
 * @param {unknown} value
 * @param {Bounds} bounds
 * @returns {Kind}
 */
export function kindOf(value, { min, max }) {
  if (typeof value !== "number" || Number.isNaN(value)) return "unknown";
  if (value === Infinity || (max !== null && value >= max)) return "clear";
  if (value === -Infinity || (min !== null && value <= min)) return "close";
  return "in";
}

/**
 * @param {unknown} value
 * @param {Bounds} bounds
 * @returns {Zone}
 */
export function zoneOf(value, bounds) {
  const kind = kindOf(value, bounds);
  if (kind === "close") return "stop";
  if (kind !== "in" || typeof value !== "number") return "";
  if (bounds.stop !== null && value <= bounds.stop) return "stop";
  return bounds.near !== null && value <= bounds.near ? "near" : "";
}

/**
 * Return the drawn length of a distance, 0 to 1: 1 if clear, 0 if too close.
 *
 * @param {unknown} value
 * @param {Bounds} bounds
 */
export function shareOf(value, bounds) {
  const kind = kindOf(value, bounds);
  if (kind === "clear") return 1;
  if (kind !== "in" || typeof value !== "number") return 0;
  const most = bounds.max ?? Math.max(1, value);
  return Math.min(1, Math.max(0, value / most));
}

/**
 * Return the point of a circle around 0, 0.
 *
 * @param {number} bearing
 * @param {number} radius
 * @returns {[number, number]}
 */
export function at(bearing, radius) {
  const angle = (bearing * Math.PI) / 180;
  return [tidy(-Math.sin(angle) * radius), tidy(-Math.cos(angle) * radius)];
}

/**
 * Return the outline of a sector between two radii as an SVG path.
 *
 * @param {number} bearing direction of the middle
 * @param {number} width its angle, at most 360
 * @param {number} inner
 * @param {number} outer
 */
export function sector(bearing, width, inner, outer) {
  const half = Math.min(179.9, Math.max(0.5, width / 2));
  const far = half > 90 ? 1 : 0;
  const [ax, ay] = at(bearing + half, outer);
  const [bx, by] = at(bearing - half, outer);
  const [cx, cy] = at(bearing - half, inner);
  const [dx, dy] = at(bearing + half, inner);
  const back = inner > 0 ? `L${cx} ${cy}A${inner} ${inner} 0 ${far} 0 ${dx} ${dy}` : "L0 0";
  return `M${ax} ${ay}A${outer} ${outer} 0 ${far} 1 ${bx} ${by}${back}Z`;
}

/**
 * Return one direction for each of `count` sensors: the given direction, or evenly spaced by default.
 *
 * @param {readonly unknown[]} given
 * @param {number} count
 */
export function bearings(given, count) {
  return Array.from({ length: count }, (_, index) => {
    const one = given[index];
    return typeof one === "number" && Number.isFinite(one) ? one : (360 * index) / Math.max(1, count);
  });
}

/**
 * Mark a text for the catalogues; it is translated elsewhere.
 *
 * @param {string} text
 */
const mark = (text) => text;
const SIDES = [
  mark("ahead"),
  mark("ahead left"),
  mark("left"),
  mark("behind left"),
  mark("behind"),
  mark("behind right"),
  mark("right"),
  mark("ahead right"),
];

/**
 * Return a direction in words.
 *
 * @param {number} bearing
 */
export function sideOf(bearing) {
  const turn = (((bearing % 360) + 360) % 360) / 45;
  return SIDES[Math.round(turn) % 8] ?? "ahead";
}

/**
 * Return the index of the nearest known distance.
 *
 * @param {readonly unknown[]} values
 * @param {Bounds} bounds
 */
export function nearestOf(values, bounds) {
  let found = 0;
  let least = Infinity;
  values.forEach((value, index) => {
    const kind = kindOf(value, bounds);
    if (kind === "unknown") return;
    const distance = kind === "close" ? -1 : kind === "clear" ? Number.MAX_VALUE : Number(value);
    if (distance < least) [found, least] = [index, distance];
  });
  return found;
}

/**
 * Return a note about the other sensors: directions without a measurement, and old values. The note is
 * empty if all sensors have the state of the shown sensor.
 *
 * @param {readonly string[]} sides direction of each sensor, in words
 * @param {readonly string[]} said note about each, or ""
 * @param {number} shown index of the shown sensor
 */
export function besides(sides, said, shown) {
  if (said.every((words) => words === said[shown])) return [];
  /** @type {Map<string, string[]>} */
  const found = new Map();
  said.forEach((words, index) => {
    if (index === shown || words === "") return;
    found.set(words, [...(found.get(words) ?? []), sides[index] ?? ""]);
  });
  return [...found].map(([words, places]) => `${[...new Set(places)].join(", ")}: ${words}`);
}

/** One distance over the last minutes, with a limited number of points. */
export class Track {
  /**
   * @param {number} windowS
   * @param {number} [most]
   */
  constructor(windowS, most = 600) {
    this.windowS = windowS;
    this.most = most;
    /** Time in seconds and drawn length; null is a gap. @type {[number, number | null][]} */
    this.points = [];
  }

  /**
   * @param {number} timeS
   * @param {number | null} share
   */
  add(timeS, share) {
    const last = this.points.at(-1);
    if (last && timeS <= last[0]) return;
    if (last && share === null && last[1] === null) return;
    this.points.push([timeS, share]);
    while (this.points.length > this.most || (this.points[1]?.[0] ?? Infinity) < timeS - this.windowS) {
      this.points.shift();
    }
  }
}

/** @param {number} value */
function tidy(value) {
  return Math.round(value * 100) / 100 + 0;
}
