// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Hand} Hand */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/widgets/response_curve.js").DeadMan} DeadMan */
/** @typedef {import("../../urc/web/static/widgets/motion.js").Look} Look */
import { gate, settingsOf } from "urc/response_curve";
import { attribute, drawing, part, write } from "urc/kit";
import { along, DIRECTIONS, directed, Motion, pointed, pulled, speak, waysOf } from "urc/motion";

/** Travel of the knob, and size of the face, in units of the drawing. */
const TRAVEL = 56;
const FACE = 200;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options } = ctx;
    if (!el.querySelector(".joystick-pad")) return {}; // no command is bound
    const stick = new Stick(ctx);
    const motion = new Motion(ctx, "joystick", "moved");
    motion.hold({
      el: stick.pad,
      keys: stick.keys(),
      keysOn: [part(el, ".joystick-values")],
      pad: options["pad"] === "left" || options["pad"] === "right" ? options["pad"] : "",
      stays: stick.stays.x || stick.stays.y,
      push: (hand, isNew) => stick.push(hand, isNew),
      draw: (look) => stick.draw(look),
    });
    return motion.instance();
  },
};

class Stick {
  /** @param {Context} ctx */
  constructor({ el, options, t, command }) {
    this.t = t;
    this.named = command("moved")?.arguments ?? {};
    this.pad = part(el, ".joystick-pad");
    this.face = drawing(el, ".joystick-face");
    this.all = drawing(el, ".joystick-all");
    this.thumb = drawing(el, ".joystick-thumb");
    this.way = drawing(el, ".joystick-way");
    this.x = el.querySelector(".joystick-x");
    this.y = el.querySelector(".joystick-y");
    this.axes = String(options["axes"] ?? "both");
    this.isFloating = options["origin"] === "floating";
    this.shape = settingsOf(options).gate;
    this.stays = { x: options["spring_x"] === false, y: options["spring_y"] === false };
    this.keyLevel = Number(options["keys"] ?? 0.5);
    /** CSS pixels at full deflection, and middle of the face; measured once per gesture. */
    this.reach = 1;
    this.shift = { x: 0, y: 0 };
    /** Position that the stick keeps; the next drag begins there. */
    this.base = { x: 0, y: 0 };
    this.at = { x: 0, y: 0 };
    this.kind = "";
  }

  keys() {
    const { ahead, back, left, right } = DIRECTIONS;
    const [along, across] = [[...ahead, ...back], [...left, ...right]];
    return this.axes === "x" ? along : this.axes === "y" ? across : [...along, ...across];
  }

  /**
   * @param {Hand} hand
   * @param {boolean} isNew
   */
  push(hand, isNew) {
    const wasStaying = this.kind === "stay" && !isNew;
    if (hand.kind === "pointer" && (isNew || wasStaying)) this.measure(hand);
    if (isNew) this.base = { x: 0, y: 0 };
    if (hand.kind === "stay") this.base = this.stayed();
    this.kind = hand.kind;
    let { x, y } = this.where(hand);
    if (this.axes === "x") y = 0;
    if (this.axes === "y") x = 0;
    [x, y] = gate(x, y, this.shape);
    this.at = { x, y };
    return { push: along(this.axes, this.at), isFine: hand.kind !== "keys" };
  }

  /** Return the position after a release: sprung axes return to zero. */
  stayed() {
    return { x: this.stays.x ? this.at.x : 0, y: this.stays.y ? this.at.y : 0 };
  }

  /** @param {Hand} hand */
  where(hand) {
    if (hand.kind === "pad") return { x: -hand.axes[1], y: -hand.axes[0] };
    if (hand.kind === "stay") return this.base;
    if (hand.kind === "keys") {
      const { x, y } = pointed(hand.keys);
      return { x: x * this.keyLevel, y: y * this.keyLevel };
    }
    const { x, y } = pulled(hand, this.reach);
    return { x: this.base.x + x, y: this.base.y + y };
  }

  /** @param {Hand} hand */
  measure({ startX, startY }) {
    const { left, top, width, height } = this.face.getBoundingClientRect();
    const scale = Math.min(width, height) / FACE || 1;
    this.reach = scale * TRAVEL;
    this.shift = { x: (startX - left - width / 2) / scale, y: (startY - top - height / 2) / scale };
  }

  /**
   * Show the value of an axis, and announce the same text to screen readers.
   *
   * @param {Element | null} el
   * @param {"x" | "y"} axis
   * @param {import("../../urc/web/static/widgets/response_curve.js").Push} values
   */
  tell(el, axis, values) {
    if (!el) return;
    const [ahead, back] = waysOf(axis, this.named[axis]);
    write(el, directed(axis, values[axis], this.named[axis], this.t));
    speak(el, values[axis], this.t(ahead), this.t(back));
  }

  /** @param {Look} look */
  draw({ push, values }) {
    const { x = 0, y = 0 } = push ?? {};
    attribute(this.thumb, "transform", move(-y * TRAVEL, -x * TRAVEL));
    const isAway = this.isFloating && push !== null && this.kind === "pointer";
    attribute(this.all, "transform", isAway ? move(this.shift.x, this.shift.y) : move(0, 0));
    attribute(this.way, "d", push ? wedge(x, y) : "");
    this.tell(this.x, "x", values);
    this.tell(this.y, "y", values);
  }
}

/**
 * @param {number} right
 * @param {number} down
 */
function move(right, down) {
  return `translate(${right.toFixed(1)} ${down.toFixed(1)})`;
}

/** Half of the angle of the wedge, in radians. */
const WEDGE = 0.35;

/**
 * Return the path of the wedge that points in the direction of the push. Its length shows the strength.
 *
 * @param {number} x away from the operator, -1 to 1
 * @param {number} y to the left
 */
function wedge(x, y) {
  const size = Math.min(1, Math.hypot(x, y));
  if (size < 0.02) return "";
  const [angle, reach] = [Math.atan2(-y, x), 40 + size * 54];
  const [from, to] = [angle - WEDGE, angle + WEDGE].map((one) => {
    return `${(Math.sin(one) * reach).toFixed(1)} ${(-Math.cos(one) * reach).toFixed(1)}`;
  });
  return `M0 0L${from}A${reach.toFixed(1)} ${reach.toFixed(1)} 0 0 1 ${to}Z`;
}
