// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Hand} Hand */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { bounded, snapped } from "urc/response_curve";
import { clamp, part, style, write } from "urc/kit";
import { DIRECTIONS, Motion, measured, pointed, pulled, speak } from "urc/motion";

/** Half of the thumb's size, which is the margin of the track at either end, in CSS pixels. */
const MARGIN = 24;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options } = ctx;
    if (!el.querySelector(".axis-lever")) return {}; // no command is bound
    const lever = new Lever(ctx);
    const motion = new Motion(ctx, "axis", "moved");
    motion.hold({
      el: lever.el,
      keys: lever.isUpright
        ? [...DIRECTIONS.ahead, ...DIRECTIONS.back]
        : [...DIRECTIONS.left, ...DIRECTIONS.right],
      pad: options["pad"] === "left" || options["pad"] === "right" ? options["pad"] : "",
      stays: options["stay"] === true,
      push: (hand, isNew) => lever.push(hand, isNew),
      draw: ({ phase, push, values }) => lever.draw(phase === "held", push?.["value"] ?? 0, values["value"] ?? 0),
    });
    const { update } = motion.instance();
    return {
      update(readings, outputs) {
        lever.echo(readings["echo"]);
        update?.(readings, outputs);
      },
    };
  },
};

class Lever {
  /** @param {Context} ctx */
  constructor({ el, options, t, command }) {
    this.t = t;
    this.argument = command("moved")?.arguments["value"];
    this.el = part(el, ".axis-lever");
    this.track = part(el, ".axis-track");
    this.mark = part(el, ".axis-echo");
    this.beside = part(el, ".axis-beside");
    this.value = part(el, ".axis-value");
    this.isUpright = options["direction"] !== "horizontal";
    this.keyLevel = Number(options["keys"] ?? 0.5);
    const detents = Array.isArray(options["detents"]) ? options["detents"] : [0];
    this.detents = detents.map(Number).filter(Number.isFinite);
    this.snap = Number(options["snap"] ?? 0);
    this.reach = 1;
    this.base = 0;
    this.at = 0;
    this.kind = "";
  }

  /**
   * @param {Hand} hand
   * @param {boolean} isNew
   */
  push(hand, isNew) {
    if (isNew) this.base = 0;
    if (hand.kind === "pointer" && (isNew || this.kind === "stay")) {
      const { width, height } = this.track.getBoundingClientRect();
      this.reach = Math.max(1, (this.isUpright ? height : width) / 2 - MARGIN);
    }
    if (hand.kind === "stay" && this.kind !== "stay") this.base = this.at;
    this.kind = hand.kind;
    const isByDegrees = hand.kind !== "keys";
    this.at = isByDegrees ? snapped(this.where(hand), this.detents, this.snap) : this.where(hand);
    return { push: { value: this.at }, isFine: isByDegrees };
  }

  /** @param {Hand} hand */
  where(hand) {
    if (hand.kind === "stay") return this.base;
    if (hand.kind === "pad") return bounded(this.isUpright ? -hand.axes[1] : hand.axes[0]);
    if (hand.kind === "keys") {
      const { x, y } = pointed(hand.keys);
      return (this.isUpright ? x : -y) * this.keyLevel;
    }
    const { x, y } = pulled(hand, this.reach);
    return bounded(this.base + (this.isUpright ? x : -y));
  }

  /**
   * @param {boolean} isHeld
   * @param {number} at
   * @param {number} value
   */
  draw(isHeld, at, value) {
    style(this.track, "--axis-at", at.toFixed(3));
    const text = measured(value, this.argument);
    write(this.value, text);
    write(this.beside, isHeld ? text : "");
    const { t } = this;
    speak(this.el, value, this.isUpright ? t("up") : t("to the right"), this.isUpright ? t("down") : t("to the left"));
  }

  /** Draw the position that the robot reports, if the position is within the scale. @param {Reading | undefined} reading */
  echo(reading) {
    const { min, max } = reading?.signal ?? {};
    const value = reading?.value;
    const isKnown = typeof value === "number" && min !== undefined && max !== undefined && max > min;
    this.mark.hidden = !isKnown || !Number.isFinite(value);
    if (!isKnown) return;
    style(this.track, "--axis-echo", ((clamp(value, min, max) - min) / (max - min) * 2 - 1).toFixed(3));
    const state = reading?.state ?? "none";
    if (this.mark.dataset["state"] !== state) this.mark.dataset["state"] = state;
  }
}
