// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Value} Value */
import { grasp } from "urc/command_kit";
import { attribute, drawing, format, part, write } from "urc/kit";
import { DIRECTIONS, pointed } from "urc/motion";
import { cutTo, polar } from "urc/path_simplify";

/** Radius of the rim, in units of the drawing, which is 200 wide. */
const RIM = 90;
const FACE = 200;
/** Drag in pixels below which a press is a tap, which sets the end of the vector. */
const TAP = 6;
const ARROWS = Object.values(DIRECTIONS).flat();

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    if (!ctx.el.querySelector(".vector-pad-field")) return {}; // no command is bound
    const pad = new VectorPad(ctx);
    pad.listen();
    return {
      update(_, { go }) {
        pad.notice = go?.notice ?? "";
        pad.reason = go?.reason ?? ctx.t("no command is bound to this pad");
        if (pad.reason) pad.hold?.drop();
        pad.isAnswered = go?.isAnswered ?? false;
        pad.draw();
      },
    };
  },
};

class VectorPad {
  /** @param {Context} ctx */
  constructor(ctx) {
    const { el, options } = ctx;
    this.ctx = ctx;
    this.root = part(el, ".vector-pad");
    this.field = part(el, ".vector-pad-field");
    this.face = drawing(el, ".vector-pad-face");
    this.ghost = drawing(el, ".vector-pad-ghost");
    this.line = drawing(el, ".vector-pad-line");
    this.end = drawing(el, ".vector-pad-end");
    this.value = part(el, ".vector-pad-value");
    this.note = part(el, ".vector-pad-note");
    this.go = part(el, ".vector-pad-go");
    this.clear = part(el, ".vector-pad-clear");
    this.length = Number(options["length"] ?? 1);
    this.unit = String(options["unit"] ?? "");
    this.step = Number(options["step"] ?? 0.1);
    this.isSentByRelease = options["send"] !== "button";
    this.reason = ctx.t("not ready yet");
    /** Why the command may have no effect, or "". */
    this.notice = "";
    this.isAnswered = false;
    /** Drawn vector as fractions of the length; null without a vector. @type {[number, number] | null} */
    this.at = null;
    /** @type {[number, number] | null} */
    this.last = null;
    /** Present pointer capture. @type {import("../../urc/web/static/control/pointer_capture.js").Grasp | null} */
    this.hold = null;
    /** @type {[number, number]} */
    this.start = [0, 0];
    this.scale = 1;
    /** @type {[number, number]} */
    this.middle = [0, 0];
    this.isTap = true;
    this.isBusy = false;
    this.outcome = "";
  }

  listen() {
    const { field, ctx } = this;
    const options = { signal: ctx.signal };
    this.hold = grasp(field, {
      take: (event) => this.down(event),
      move: (event) => this.move(event),
      release: (event) => this.up(event),
      cancel: () => this.set(null),
      isDrawing: true,
      signal: ctx.signal,
    });
    field.addEventListener("keydown", (event) => this.key(event), options);
    this.go.addEventListener("click", () => void this.send(), options);
    this.clear.addEventListener("click", () => this.set(null), options);
  }

  /** @param {PointerEvent} event */
  down(event) {
    if (this.reason || this.isBusy) return false;
    const { left, top, width, height } = this.face.getBoundingClientRect();
    this.scale = (Math.min(width, height) * RIM) / FACE || 1;
    this.middle = [left + width / 2, top + height / 2];
    this.start = [event.clientX, event.clientY];
    this.isTap = true;
    return true;
  }

  /** Draw from the start of the touch, so that the vector does not jump. @param {PointerEvent} event */
  move(event) {
    const [right, down] = [event.clientX - this.start[0], event.clientY - this.start[1]];
    if (this.isTap && Math.hypot(right, down) < TAP) return;
    this.isTap = false;
    this.set([-down / this.scale, -right / this.scale]);
  }

  /** @param {PointerEvent} event */
  up(event) {
    if (this.isTap) {
      const [across, along] = [event.clientX - this.middle[0], event.clientY - this.middle[1]];
      this.set([-along / this.scale, -across / this.scale]);
    } else if (this.isSentByRelease) {
      void this.send();
    }
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || this.reason) return;
    if (ARROWS.includes(event.code)) {
      const { x, y } = pointed(new Set([event.code]));
      const [dx, dy] = this.at ?? [0, 0];
      this.set([dx + x * this.step, dy + y * this.step]);
    } else if (event.code === "Enter" && !event.repeat) {
      void this.send();
    } else if (event.code === "Backspace" || event.code === "Delete") {
      this.set(null);
    } else {
      return;
    }
    event.preventDefault();
  }

  /** @param {[number, number] | null} at */
  set(at) {
    if (this.isBusy) return;
    this.at = at && cutTo(at[0], at[1], 1);
    this.outcome = "";
    this.draw();
  }

  /** Return the arguments that the command declares. */
  given() {
    const [x, y] = this.at ?? [0, 0];
    const { heading, distance } = polar(x, y);
    const all = { dx: x * this.length, dy: y * this.length, heading, distance: distance * this.length };
    const takes = this.ctx.command("go")?.arguments ?? {};
    const pairs = Object.entries(all).filter(([name]) => Object.hasOwn(takes, name));
    return Object.fromEntries(pairs.map(([name, value]) => [name, Math.round(value * 1e4) / 1e4 + 0]));
  }

  async send() {
    if (!this.at || this.isBusy || this.reason) return;
    const { t } = this.ctx;
    this.isBusy = true;
    this.outcome = t("… sending");
    this.draw();
    try {
      await this.ctx.send("go", this.given());
      this.last = this.at;
      this.outcome = this.isAnswered ? t("✓ done") : t("✓ sent");
    } catch (error) {
      this.outcome = `▲ ${error instanceof Error ? error.message : error}`;
    }
    this.isBusy = false;
    this.at = null;
    this.draw();
  }

  draw() {
    const { at, last, reason, ctx } = this;
    attribute(this.root, "data-phase", reason ? "locked" : this.isBusy ? "busy" : at ? "drawn" : "idle");
    point(this.line, at);
    point(this.ghost, last);
    const [x, y] = at ?? [0, 0];
    attribute(this.end, "cx", (-y * RIM).toFixed(1));
    attribute(this.end, "cy", (-x * RIM).toFixed(1));
    write(this.value, at ? this.words(x, y) : "—");
    for (const button of [this.go, this.clear]) attribute(button, "disabled", at && !this.isBusy && !reason ? null : "");
    const why = reason || (this.outcome ? "" : this.notice);
    write(this.note, why ? `◆ ${why}` : this.outcome || ctx.t("drag to draw a vector, or tap its end"));
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  words(x, y) {
    const { heading, distance } = polar(x, y);
    const degrees = Math.round((heading * 180) / Math.PI) + 0;
    const side = degrees > 0 ? this.ctx.t("to the left") : degrees < 0 ? this.ctx.t("to the right") : "";
    return `${format(distance * this.length, 2)} ${this.unit} · ${Math.abs(degrees)}° ${side}`.trim();
  }
}

/**
 * @param {Element} line
 * @param {[number, number] | null} at
 */
function point(line, at) {
  const [x, y] = at ?? [0, 0];
  attribute(line, "x2", (-y * RIM).toFixed(1));
  attribute(line, "y2", (-x * RIM).toFixed(1));
}
