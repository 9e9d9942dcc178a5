// @ts-check
/**
 * Response curves of held controls: `import { Pipeline } from "urc/response_curve"`. Pure maths.
 *
 * All inputs share one pipeline, in this order: gate, dead zone, expo, invert, scale and speed
 * step, slew rate. A push is a set of shares by name, each from -1 to 1. `x` and `y` form a vector:
 * x is forward, y is left (REP 103); any other name is independent.
 *
 * @typedef {"circle" | "square" | "cross"} DeadMan
 * @typedef {Record<string, number>} Push
 *
 * @typedef {object} Settings
 * @property {DeadMan} gate Shape of the range: a circle, a square, or one axis at a time.
 * @property {number} deadZone Share of the travel that counts as zero, 0 to 0.5.
 * @property {number} expo 0 is linear, 1 is cubic.
 * @property {number} scale Share of the command's range at full deflection, 0 to 1.
 * @property {number} slew Largest change of the share per second while it speeds up; 0 for no limit.
 * @property {ReadonlySet<string>} inverted Names with inverted sign.
 *
 * @typedef {object} Moment
 * @property {number} dtS Time since the last sample, in seconds; 0 starts from zero.
 * @property {number} [speed] The speed step, 0 to 1.
 * @property {boolean} [isFine] Whether the push is continuous, so that dead zone and expo apply; a key is
 *   either down or not.
 */

/**
 * Return 0 within the dead zone; the remaining travel covers the whole range.
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
 * Return a share with finer response around the centre: (1 - e)·x + e·x³.
 *
 * @param {number} share
 * @param {number} amount
 */
export function expo(share, amount) {
  return (1 - amount) * share + amount * share ** 3;
}

/**
 * Return the next share towards the target. Deceleration is never limited, and a reversal begins at
 * zero.
 *
 * @param {number} before
 * @param {number} target
 * @param {number} perS largest change per second while it speeds up; 0 for no limit
 * @param {number} dtS
 */
export function slew(before, target, perS, dtS) {
  if (perS <= 0) return target;
  const from = before * target > 0 ? Math.abs(before) : 0;
  const size = Math.abs(target);
  return Math.sign(target) * Math.min(size, Math.max(from, 0) + perS * dtS);
}

/**
 * Limit a push to the gate.
 *
 * @param {number} x
 * @param {number} y
 * @param {DeadMan} shape
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
 * Apply dead zone and expo within the gate, to the length in a circle and otherwise to each axis.
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

/** The pipeline with its last sample, which is needed only for the slew rate. */
export class Pipeline {
  /** @param {Settings} settings */
  constructor(settings) {
    this.settings = settings;
    /** @type {Push} */
    this.last = {};
  }

  /**
   * Return the shares to send, each rounded to a thousandth.
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
 * Return the settings in a widget's options.
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
 * Return the speed steps in a widget's options, slowest first; at least one.
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
 * Return the tilt of a device from its rest position, as a push.
 *
 * @param {{beta: number, gamma: number}} now angles from the browser, in degrees
 * @param {{beta: number, gamma: number}} rest
 * @param {number} angle angle of the screen, degrees
 * @param {number} range degrees at full deflection
 * @returns {{x: number, y: number}} x away from the operator, y to the left; not limited yet
 */
export function tilted(now, rest, angle, range) {
  const beta = turn(now.beta - rest.beta);
  const gamma = turn(now.gamma - rest.gamma);
  const [cos, sin] = [Math.cos((angle * Math.PI) / 180), Math.sin((angle * Math.PI) / 180)];
  const right = gamma * cos + beta * sin;
  const nearer = beta * cos - gamma * sin;
  return { x: -nearer / range + 0, y: -right / range + 0 }; // + 0 avoids -0
}

/**
 * Return the direction in a cross of arrows for a pointer position.
 *
 * @param {number} x distance from the middle, away from the operator; 1 is the edge
 * @param {number} y the same to the left
 * @param {boolean} isDiagonal whether there are diagonal arrows
 * @param {number} rest share around the middle without direction
 * @returns {{x: number, y: number}} each -1, 0 or 1
 */
export function arrow(x, y, isDiagonal, rest) {
  if (Math.max(Math.abs(x), Math.abs(y)) < rest) return { x: 0, y: 0 };
  const one = (/** @type {number} */ share) => Math.sign(share) * Number(Math.abs(share) >= rest) + 0;
  if (isDiagonal) return { x: one(x), y: one(y) };
  return Math.abs(x) >= Math.abs(y) ? { x: one(x), y: 0 } : { x: 0, y: one(y) };
}

/**
 * Return a lever's position: a detent within reach, or the share itself.
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

/** @param {number} value non-finite values count as 0 */
function finite(value) {
  return Number.isFinite(value) ? value : 0;
}

/** @param {number} share */
function rounded(share) {
  return Math.round(share * 1000) / 1000 + 0; // + 0 avoids -0
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
