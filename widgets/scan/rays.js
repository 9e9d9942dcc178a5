// @ts-check
/**
 * The geometry of a scan: positions of rays, the nearest obstacle, zones. Pure: no DOM.
 *
 * Angles are radians from straight ahead, counter-clockwise (REP 103). A pixel's x is to the right and
 * its y down, so ahead is up and left is left.
 *
 * @typedef {import("./fan.js").Fan} Fan
 */

const TURN = 2 * Math.PI;
/** Time for which the obstacles must be nearer before the picture is enlarged. */
const SHRINK_AFTER_S = 2;

/**
 * Return the distances to draw: NaN if unknown, `most` if clear, and 0 if an obstacle is too close
 * (REP 117).
 *
 * @param {readonly unknown[]} ranges
 * @param {number} least
 * @param {number} most
 * @param {Float32Array} into result, as long as `ranges`
 */
export function measured(ranges, least, most, into) {
  for (let index = 0; index < into.length; index += 1) {
    const value = ranges[index];
    if (typeof value !== "number" || Number.isNaN(value)) into[index] = NaN;
    else if (value >= most) into[index] = most;
    else into[index] = value <= least ? 0 : value;
  }
  return into;
}

/**
 * Return sine and cosine of each ray in the drawing: multiply them by a distance in pixels.
 *
 * @param {Fan} fan
 */
export function directions(fan) {
  const right = new Float32Array(fan.count);
  const down = new Float32Array(fan.count);
  for (let index = 0; index < fan.count; index += 1) {
    right[index] = -Math.sin(fan.angleAt(index));
    down[index] = -Math.cos(fan.angleAt(index));
  }
  return { right, down };
}

/**
 * Return the direction of each pixel of a square image around the sensor, in radians.
 *
 * @param {number} size pixels
 */
export function bearingOfPixels(size) {
  const bearings = new Float32Array(size * size);
  const centre = (size - 1) / 2;
  for (let y = 0; y < size; y += 1) {
    for (let x = 0; x < size; x += 1) bearings[y * size + x] = Math.atan2(centre - x, centre - y);
  }
  return bearings;
}

/**
 * Return the ray through each pixel.
 *
 * @param {Fan} fan
 * @param {Float32Array} bearings direction of each pixel
 */
export function rayOfPixels(fan, bearings) {
  const rays = new Uint16Array(bearings.length);
  for (let place = 0; place < rays.length; place += 1) rays[place] = fan.rayAt(bearings[place] ?? 0);
  return rays;
}

/**
 * Return the distance of each pixel from the sensor in a square image, in pixels.
 *
 * @param {number} size
 */
export function reachOfPixels(size) {
  const reach = new Float32Array(size * size);
  const centre = (size - 1) / 2;
  for (let y = 0; y < size; y += 1) {
    for (let x = 0; x < size; x += 1) reach[y * size + x] = Math.hypot(x - centre, y - centre);
  }
  return reach;
}

/**
 * Return the nearest obstacle and its direction; null without an obstacle in range. An obstacle below the
 * range counts as 0.
 *
 * @param {Float32Array} distances
 * @param {Fan} fan
 * @param {number} most
 * @returns {{distance: number, angle: number} | null}
 */
export function nearest(distances, fan, most) {
  let found = -1;
  let least = most;
  for (let index = 0; index < distances.length; index += 1) {
    const distance = distances[index] ?? NaN;
    if (distance < least) {
      least = distance;
      found = index;
    }
  }
  return found < 0 ? null : { distance: least, angle: fan.angleAt(found) };
}

/** Round distances for the rim, between two powers of ten. */
const RIMS = [1, 1.25, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10];
/** Fraction of the obstacles that lie within the rim. */
const WITHIN = 0.9;
/** Margin outside them. */
const MARGIN = 1.05;

/**
 * Return a round distance for the rim that nine of ten obstacles lie within; `most` without obstacles.
 *
 * @param {Float32Array} distances
 * @param {number} most
 */
export function rimOf(distances, most) {
  const seen = distances.filter((each) => each < most).sort();
  const far = (seen[Math.ceil(seen.length * WITHIN) - 1] ?? 0) * MARGIN;
  if (!(far > 0)) return most;
  const power = 10 ** Math.floor(Math.log10(far));
  return Math.min(most, (RIMS.find((each) => each * power >= far) ?? 10) * power);
}

/** The distance at the rim of the picture: it grows at once, and shrinks after some seconds. */
export class Rim {
  constructor() {
    this.value = 0;
    this.sinceS = NaN;
  }

  /**
   * @param {number} wanted
   * @param {number} timeS
   */
  follow(wanted, timeS) {
    const isSmaller = wanted < this.value;
    if (isSmaller && Number.isNaN(this.sinceS)) this.sinceS = timeS;
    if (!isSmaller) this.sinceS = NaN;
    if (isSmaller && !(timeS - this.sinceS >= SHRINK_AFTER_S)) return this.value;
    this.sinceS = NaN;
    this.value = wanted;
    return wanted;
  }
}

/**
 * Return the fraction of the height that a wall fills at a distance: 1 at `close`, almost 0 far away.
 *
 * @param {number} distance
 * @param {number} close
 */
export function wallHeight(distance, close) {
  return distance <= close ? 1 : Math.max(0.02, close / distance);
}

/**
 * Return the ray of each column in the robot's view: left is left.
 *
 * @param {Fan} fan
 * @param {number} columns
 */
export function raysOfColumns(fan, columns) {
  const last = Math.max(1, columns - 1);
  return Uint16Array.from({ length: columns }, (_, column) => fan.across(column / last));
}

/**
 * Return a round distance for rings: 1, 2 or 5 times a power of ten, with at most `count` rings.
 *
 * @param {number} most
 * @param {number} [count]
 */
export function ringStep(most, count = 5) {
  if (!(most > 0)) return 1;
  const rough = most / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((each) => each * power >= rough * 0.999) ?? 10;
  return step * power;
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
 * @param {number} angle radians
 */
export function sideOf(angle) {
  const turn = (((angle % TURN) + TURN) % TURN) / (TURN / 8);
  return SIDES[Math.round(turn) % 8] ?? "ahead";
}
