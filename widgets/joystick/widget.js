// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Hand} Hand */
/** @typedef {import("../../urc/web/static/types.js").HoldState} HoldState */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */

/** How far the knob goes, and the whole face, in units of the drawing. */
const TRAVEL = 56;
const FACE = 200;

const WORDS = { idle: "", asking: "… taking the controls", held: "", spent: "" };

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, hold } = ctx;
    const pad = el.querySelector(".joystick-pad");
    if (!(pad instanceof HTMLElement)) return {}; // no command is bound: there is nothing to do
    const stick = new Stick(el, pad, options);
    const side = options["pad"] === "left" || options["pad"] === "right" ? options["pad"] : "";
    hold("moved", {
      el: pad,
      keys: stick.keys(),
      pad: side,
      sample: (hand) => stick.sample(hand),
      show: (state) => stick.show(state),
    });
    return {
      update(_, { moved }) {
        stick.reason = moved?.reason ?? "no command is bound to this stick";
        stick.draw();
      },
    };
  },
};

class Stick {
  /**
   * @param {HTMLElement} el
   * @param {HTMLElement} pad
   * @param {Readonly<Record<string, unknown>>} options
   */
  constructor(el, pad, options) {
    this.pad = pad;
    this.root = find(el, ".joystick");
    this.face = find(el, ".joystick-face");
    this.knob = find(el, ".joystick-knob");
    this.note = find(el, ".joystick-note");
    this.x = el.querySelector(".joystick-x");
    this.y = el.querySelector(".joystick-y");
    this.axes = String(options["axes"] ?? "both");
    this.deadZone = Number(options["dead_zone"] ?? 0);
    this.expo = Number(options["expo"] ?? 0);
    this.keyLevel = Number(options["keys"] ?? 0.5);
    this.reason = "not ready yet";
    /** @type {HoldState} */
    this.state = { phase: "idle", reason: "", values: null };
    /** Where the knob is, right and down, -1 to 1. @type {[number, number]} */
    this.at = [0, 0];
  }

  keys() {
    const along = ["ArrowUp", "ArrowDown"];
    const across = ["ArrowLeft", "ArrowRight"];
    return this.axes === "x" ? along : this.axes === "y" ? across : [...along, ...across];
  }

  /**
   * Forward is x, left is y (REP 103).
   *
   * @param {Hand} hand
   */
  sample(hand) {
    let [right, down] = this.push(hand);
    if (this.axes === "x") right = 0;
    if (this.axes === "y") down = 0;
    const length = Math.hypot(right, down);
    if (length > 1) {
      right /= length;
      down /= length;
    }
    this.at = [right, down];
    const shape = hand.kind === "keys" ? (/** @type {number} */ share) => share : this.shape();
    const reach = Math.min(1, length);
    const gain = reach > 0 ? shape(reach) / reach : 0;
    return { x: round(-down * gain), y: round(-right * gain) };
  }

  /**
   * @param {Hand} hand
   * @returns {[number, number]} right and down; 1 is the rim
   */
  push(hand) {
    if (hand.kind === "pad") return [hand.axes[0], hand.axes[1]];
    if (hand.kind === "keys") {
      const is = (/** @type {string} */ code) => Number(hand.keys.has(code));
      const right = is("ArrowRight") - is("ArrowLeft");
      const down = is("ArrowDown") - is("ArrowUp");
      return [right * this.keyLevel, down * this.keyLevel];
    }
    // Where it was touched first is the centre: nothing jumps.
    const { width, height } = this.face.getBoundingClientRect();
    const rim = (Math.min(width, height) * TRAVEL) / FACE || 1;
    return [(hand.x - hand.startX) / rim, (hand.y - hand.startY) / rim];
  }

  /** Nothing within the dead zone, and from its edge on a curve from 0 to 1. */
  shape() {
    return (/** @type {number} */ share) => {
      const out = Math.max(0, (share - this.deadZone) / (1 - this.deadZone));
      return (1 - this.expo) * out + this.expo * out ** 3;
    };
  }

  /** @param {HoldState} state */
  show(state) {
    this.state = state;
    if (!state.values) this.at = [0, 0]; // it springs back; what counts was sent before
    this.draw();
  }

  draw() {
    const { phase, reason, values } = this.state;
    const isLocked = this.reason !== "" && phase === "idle";
    attribute(this.root, "data-phase", isLocked ? "locked" : phase);
    const [right, down] = this.at;
    const place = `translate(${(right * TRAVEL).toFixed(1)} ${(down * TRAVEL).toFixed(1)})`;
    attribute(this.knob, "transform", place);
    const isMoving = phase === "held";
    if (this.x) write(this.x, signed(isMoving ? values?.["x"] : 0));
    if (this.y) write(this.y, signed(isMoving ? values?.["y"] : 0));
    const ended = phase === "spent" && reason ? `◆ ${reason}` : "";
    write(this.note, ended || WORDS[phase] || (isLocked ? `◆ ${this.reason}` : ""));
  }
}

/** @param {number} value */
function round(value) {
  return Math.round(value * 1000) / 1000 + 0; // no minus zero
}

/** @param {unknown} value */
function signed(value) {
  const number = typeof value === "number" ? value : 0;
  const text = Math.abs(number).toFixed(2);
  return Number(text) === 0 ? text : `${number < 0 ? "−" : "+"}${text}`;
}

/**
 * @param {Element} root
 * @param {string} selector
 */
function find(root, selector) {
  const found = root.querySelector(selector);
  if (!found) throw new Error(`the template has no ${selector}`);
  return found;
}

/**
 * @param {Element} el
 * @param {string} text
 */
function write(el, text) {
  if (el.textContent !== text) el.textContent = text;
}

/**
 * @param {Element} el
 * @param {string} name
 * @param {string} value
 */
function attribute(el, name, value) {
  if (el.getAttribute(name) !== value) el.setAttribute(name, value);
}
