// @ts-check
/**
 * What becomes of a push before it is sent: `import { Pipeline } from "urc/curve"`. Pure maths.
 *
 * One pipeline for everything that hands do, in this order: gate, dead zone, expo, invert, scale and
 * speed step, slew. A push is a set of shares by name, each from -1 to 1. `x` and `y` belong
 * together: x is forward, y is left (REP 103); any other name stands alone.
 *
 * @typedef {"circle" | "square" | "cross"} Gate
 * @typedef {Record<string, number>} Push
 *
 * @typedef {object} Settings
 * @property {Gate} gate How far it goes to the side: within a circle, a square, or along one axis.
 * @property {number} deadZone Share of the way in which nothing moves yet, 0 to 0.5.
 * @property {number} expo 0 is a straight line, 1 a cube.
 * @property {number} scale Share of the command's range that a full push is, 0 to 1.
 * @property {number} slew Change of the share per second while it speeds up; 0 for any.
 * @property {ReadonlySet<string>} inverted Names whose sign is turned.
 *
 * @typedef {object} Moment
 * @property {number} dtS Seconds since the last sample; 0 begins anew, from nothing.
 * @property {number} [speed] The speed step, 0 to 1.
 * @property {boolean} [isFine] Whether the push is by degrees, so that dead zone and expo count; a
 *   key is either down or not.
 */

/**
 * Nothing within the zone; from its edge on the rest of the way is the whole range.
 *
 * @param {number} share
 * @param {number} zone 0 to below 1
 */
export function deadZone(share, zone) {
  const size = Math.abs(share);
  if (size <= zone) return 0;
  return Math.sign(share) * Math.min(1, (size - zone) / (1 - zone));
}

/**
 * Finer around the centre: (1 - e)·x + e·x³.
 *
 * @param {number} share
 * @param {number} amount
 */
export function expo(share, amount) {
  return (1 - amount) * share + amount * share ** 3;
}

/**
 * The next share on the way to the target. Slowing down and stopping are never held up, and the way
 * to the other side begins at nothing.
 *
 * @param {number} before
 * @param {number} target
 * @param {number} perS largest change per second while it speeds up; 0 for any
 * @param {number} dtS
 */
export function slew(before, target, perS, dtS) {
  if (perS <= 0) return target;
  const from = before * target > 0 ? Math.abs(before) : 0;
  const size = Math.abs(target);
  return Math.sign(target) * Math.min(size, Math.max(from, 0) + perS * dtS);
}

/**
 * Keep a push within the gate.
 *
 * @param {number} x
 * @param {number} y
 * @param {Gate} shape
 * @returns {[number, number]}
 */
export function gate(x, y, shape) {
  if (shape === "circle") {
    const size = Math.hypot(x, y);
    return size > 1 ? [x / size, y / size] : [x, y];
  }
  const [boundX, boundY] = [bounded(x), bounded(y)];
  if (shape === "square") return [boundX, boundY];
  return Math.abs(x) >= Math.abs(y) ? [boundX, 0] : [0, boundY];
}

/**
 * Dead zone and expo of a push within its gate: by its length in a circle, else by each axis.
 *
 * @param {number} x
 * @param {number} y
 * @param {Settings} settings
 * @returns {[number, number]}
 */
export function curved(x, y, { gate: shape, deadZone: zone, expo: amount }) {
  const one = (/** @type {number} */ share) => expo(deadZone(share, zone), amount);
  if (shape !== "circle") return [one(x), one(y)];
  const size = Math.hypot(x, y);
  const gain = size > 0 ? one(size) / size : 0;
  return [x * gain, y * gain];
}

/** Keeps what the last sample was, which only slew needs. */
export class Pipeline {
  /** @param {Settings} settings */
  constructor(settings) {
    this.settings = settings;
    /** @type {Push} */
    this.last = {};
  }

  /**
   * Return what is sent, each share rounded to a thousandth.
   *
   * @param {Push} push
   * @param {Moment} moment
   * @returns {Push}
   */
  step(push, { dtS, speed = 1, isFine = true }) {
    const { settings } = this;
    if (dtS <= 0) this.last = {};
    const level = settings.scale * speed;
    /** @type {Push} */
    const next = {};
    for (const [name, share] of Object.entries(this.formed(push, isFine))) {
      const target = share * level * (settings.inverted.has(name) ? -1 : 1);
      next[name] = slew(this.last[name] ?? 0, target, settings.slew, dtS);
    }
    this.last = next;
    return Object.fromEntries(Object.entries(next).map(([name, share]) => [name, rounded(share)]));
  }

  /**
   * @param {Push} push
   * @param {boolean} isFine
   * @returns {Push}
   */
  formed(push, isFine) {
    const { settings } = this;
    /** @type {Push} */
    const found = {};
    for (const [name, share] of Object.entries(push)) {
      const kept = bounded(share);
      found[name] = isFine ? expo(deadZone(kept, settings.deadZone), settings.expo) : kept;
    }
    const { x, y } = push;
    if (x === undefined || y === undefined) return found;
    const kept = gate(finite(x), finite(y), settings.gate);
    [found["x"], found["y"]] = isFine ? curved(...kept, settings) : kept;
    return found;
  }
}

/**
 * Return the settings that a widget's options say.
 *
 * @param {Readonly<Record<string, unknown>>} options
 * @returns {Settings}
 */
export function settingsOf(options) {
  const shape = options["gate"];
  const turned = Object.keys(options).filter((name) => /^invert_/.test(name) && options[name] === true);
  return {
    gate: shape === "square" || shape === "cross" ? shape : "circle",
    deadZone: Math.min(0.9, Math.max(0, number(options["dead_zone"], 0))),
    expo: number(options["expo"], 0),
    scale: number(options["scale"], 1),
    slew: number(options["slew"], 0),
    inverted: new Set(turned.map((name) => name.slice("invert_".length))),
  };
}

/**
 * Return the speed steps of a widget's options, slowest first; at least one.
 *
 * @param {Readonly<Record<string, unknown>>} options
 * @returns {number[]}
 */
export function speedsOf(options) {
  const given = Array.isArray(options["speeds"]) ? options["speeds"] : [];
  const steps = given.filter((step) => typeof step === "number" && step > 0 && step <= 1);
  return steps.length > 0 ? steps.sort((one, other) => one - other) : [1];
}

/**
 * How far a device is tilted from where it rested, as a push.
 *
 * @param {{beta: number, gamma: number}} now degrees, as the browser gives them
 * @param {{beta: number, gamma: number}} rest
 * @param {number} angle of the screen, degrees
 * @param {number} range degrees of a full push
 * @returns {{x: number, y: number}} away from the person is x, to the left y; not yet bounded
 */
export function tilted(now, rest, angle, range) {
  const beta = turn(now.beta - rest.beta);
  const gamma = turn(now.gamma - rest.gamma);
  const [cos, sin] = [Math.cos((angle * Math.PI) / 180), Math.sin((angle * Math.PI) / 180)];
  const right = gamma * cos + beta * sin;
  const nearer = beta * cos - gamma * sin;
  return { x: -nearer / range + 0, y: -right / range + 0 }; // no minus zero
}

/**
 * Return the direction of a cross of arrows at which a pointer is.
 *
 * @param {number} x away from the person, from the middle; 1 is the edge
 * @param {number} y to the left
 * @param {boolean} isDiagonal whether there are arrows between the four
 * @param {number} rest share around the middle that is none
 * @returns {{x: number, y: number}} each -1, 0 or 1
 */
export function arrow(x, y, isDiagonal, rest) {
  if (Math.max(Math.abs(x), Math.abs(y)) < rest) return { x: 0, y: 0 };
  const one = (/** @type {number} */ share) => Math.sign(share) * Number(Math.abs(share) >= rest) + 0;
  if (isDiagonal) return { x: one(x), y: one(y) };
  return Math.abs(x) >= Math.abs(y) ? { x: one(x), y: 0 } : { x: 0, y: one(y) };
}

/**
 * Return the position to which a lever snaps: a detent within reach, or where it is.
 *
 * @param {number} share
 * @param {readonly number[]} detents
 * @param {number} reach
 */
export function snapped(share, detents, reach) {
  const near = detents.filter((each) => Math.abs(each - share) <= reach);
  near.sort((one, other) => Math.abs(one - share) - Math.abs(other - share));
  return near[0] ?? share;
}

/**
 * @param {number} share
 */
export function bounded(share) {
  return Math.min(1, Math.max(-1, finite(share)));
}

/** @param {number} value what is no number moves nothing */
function finite(value) {
  return Number.isFinite(value) ? value : 0;
}

/** @param {number} share */
function rounded(share) {
  return Math.round(share * 1000) / 1000 + 0; // no minus zero
}

/** @param {number} degrees */
function turn(degrees) {
  return ((((degrees + 180) % 360) + 360) % 360) - 180;
}

/**
 * @param {unknown} value
 * @param {number} otherwise
 */
function number(value, otherwise) {
  return typeof value === "number" && Number.isFinite(value) ? value : otherwise;
}
