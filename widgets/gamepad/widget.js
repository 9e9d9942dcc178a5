// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Hand} Hand */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").PadView} PadView */
import { attribute, part, style, write } from "urc/kit";
import { Motion, signed } from "urc/motion";
import { Mapping } from "./mapping.js";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const view = new TestView(ctx);
    const mapping = new Mapping(ctx);
    let isDue = false;
    const look = () => {
      isDue = false;
      if (ctx.signal.aborted) return;
      const views = ctx.pads.views();
      const shown = views.find((each) => each.isUsed) ?? views[0] ?? null;
      view.draw(shown);
      mapping.draw(shown);
      if (views.length > 0) wake();
    };
    const wake = () => {
      if (isDue) return;
      isDue = true;
      requestAnimationFrame(look);
    };
    for (const name of ["gamepadconnected", "gamepaddisconnected"]) {
      addEventListener(name, wake, { signal: ctx.signal });
    }
    wake();
    return ctx.el.querySelector(".gamepad-values") ? driving(ctx) : {};
  },
};

/** @param {Context} ctx */
function driving(ctx) {
  const { el, options } = ctx;
  const side = options["enable"] === "right" ? "right" : "left";
  const turbo = Number(options["turbo"] ?? -1);
  const [x, y, turn] = ["x", "y", "turn"].map((name) => part(el, `.gamepad-${name}`));
  const motion = new Motion(ctx, "gamepad", "moved");
  motion.hold({
    el: part(el, ".gamepad-grip"),
    keys: [],
    pad: side,
    isFree: () => false, // a touch on the picture holds no control
    push({ sticks = [0, 0, 0, 0], buttons = [] }) {
      const [across, along, turned] = sticks;
      const fastest = motion.speeds[motion.speeds.length - 1] ?? 1;
      const speed = buttons[turbo] ? fastest : motion.speed;
      return { push: { x: -along, y: -across, turn: -turned }, speed };
    },
    draw({ values }) {
      if (x) write(x, signed(values["x"]));
      if (y) write(y, signed(values["y"]));
      if (turn) write(turn, signed(values["turn"]));
    },
  });
  return motion.instance();
}

/** The present state of every axis and button of a gamepad. */
class TestView {
  /** @param {Context} ctx */
  constructor({ el, t }) {
    this.t = t;
    this.device = part(el, ".gamepad-device");
    this.axes = part(el, ".gamepad-axes");
    this.buttons = part(el, ".gamepad-buttons");
  }

  /** @param {PadView | null} view */
  draw(view) {
    const none = this.t("press a button on the gamepad");
    write(this.device, view ? this.named(view) : `— ${none}`);
    const { axes = [], buttons = [] } = view ?? {};
    this.fill(this.axes, axes.length, "gamepad-axis");
    this.fill(this.buttons, buttons.length, "gamepad-button");
    axes.forEach((value, place) => {
      const item = this.axes.children[place];
      if (!item) return;
      write(item, `${place}: ${signed(value)}`);
      style(item, "--gamepad-at", value.toFixed(2));
    });
    buttons.forEach((isDown, place) => {
      const item = this.buttons.children[place];
      if (!item) return;
      write(item, isDown ? `● ${place}` : `○ ${place}`);
      attribute(item, "data-down", isDown ? "" : null);
    });
  }

  /** @param {PadView} view */
  named({ id, map, isStandard }) {
    const name = id || this.t("gamepad");
    const [unknown, stored] = [
      this.t("Sticks unknown: assign them below"),
      this.t("as stored on this device"),
    ];
    if (!map) return `◆ ${name}: ${unknown}`;
    return isStandard ? name : `${name}: ${stored}`;
  }

  /**
   * @param {HTMLElement} list
   * @param {number} count
   * @param {string} name
   */
  fill(list, count, name) {
    while (list.children.length > count) list.lastElementChild?.remove();
    while (list.children.length < count) {
      const item = document.createElement("li");
      item.className = name;
      list.append(item);
    }
  }
}
