// @ts-check
/**
 * The mapping of a gamepad's sticks and buttons. Operators assign a stick or button by moving it.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Context} Context
 * @typedef {import("../../urc/web/static/core/types.js").PadView} PadView
 * @typedef {import("../../urc/web/static/widgets/gamepad_map.js").PadMap} PadMap
 *
 * @typedef {object} Part One part of the mapping.
 * @property {string} text
 * @property {string} how Instruction for the operator.
 * @property {number} axis Index of the axis, 0 to 3; -1 for a button.
 * @property {"left" | "right" | "slower" | "faster"} [button]
 */
import { STANDARD, movedAxis, withAxis, withButton } from "urc/gamepad_map";
import { button, part, t, write } from "urc/kit";

const LEARN = "gamepad-learn urc-pad-act";
/** @type {Part[]} */
const PARTS = [
  { text: t("Left stick, sideways"), how: t("push it to the right"), axis: 0 },
  { text: t("Left stick, along"), how: t("pull it back"), axis: 1 },
  { text: t("Right stick, sideways"), how: t("push it to the right"), axis: 2 },
  { text: t("Right stick, along"), how: t("pull it back"), axis: 3 },
  { text: t("Enables the left stick"), how: t("press a button"), axis: -1, button: "left" },
  { text: t("Enables the right stick"), how: t("press a button"), axis: -1, button: "right" },
  { text: t("Slower"), how: t("press a button"), axis: -1, button: "slower" },
  { text: t("Faster"), how: t("press a button"), axis: -1, button: "faster" },
];

export class Mapping {
  /** @param {Context} ctx */
  constructor(ctx) {
    this.ctx = ctx;
    this.root = part(ctx.el, ".gamepad-map");
    this.list = part(ctx.el, ".gamepad-parts");
    /** @type {HTMLElement[]} */
    this.places = [];
    /** @type {HTMLButtonElement[]} */
    this.buttons = [];
    /** Part that the operator is assigning, or null. @type {Part | null} */
    this.learnt = null;
    /** State of the gamepad at the start of the assignment. @type {PadView | null} */
    this.before = null;
    /** @type {PadView | null} */
    this.view = null;
    this.build();
  }

  build() {
    const { signal } = this.ctx;
    for (const one of PARTS) {
      const row = document.createElement("p");
      row.className = "gamepad-part";
      const name = document.createElement("span");
      name.textContent = `${one.text}: `;
      const place = document.createElement("span");
      const learn = button(LEARN, "", () => this.learn(one), { signal, label: `${t("Change")}: ${one.text}` });
      row.append(name, place, learn);
      this.list.append(row);
      this.places.push(place);
      this.buttons.push(learn);
    }
    const forget = () => this.view && this.ctx.pads.setMap(this.view.id, null);
    this.list.append(button(LEARN, t("As reported by the browser"), forget, { signal }));
  }

  /** @param {Part} one */
  learn(one) {
    this.learnt = this.learnt === one ? null : one;
    this.before = this.view;
  }

  /** @param {PadView | null} view */
  draw(view) {
    if (this.view?.id !== view?.id) this.learnt = null; // another gamepad was connected
    this.view = view;
    if (this.root.hidden !== !view) this.root.hidden = !view;
    if (!view) return;
    if (this.learnt && this.before) this.watch(view, this.learnt, this.before);
    PARTS.forEach((one, index) => {
      const place = this.places[index];
      const button = this.buttons[index];
      if (place) write(place, placed(one, view.map));
      if (button) write(button, this.learnt === one ? `… ${one.how}` : t("Change"));
    });
  }

  /**
   * @param {PadView} view
   * @param {Part} one
   * @param {PadView} before
   */
  watch(view, one, before) {
    const map = view.map ?? STANDARD;
    const axis = one.axis >= 0 ? movedAxis(before.axes, view.axes) : null;
    const button = one.button ? view.buttons.findIndex((isDown, place) => isDown && !before.buttons[place]) : -1;
    if (axis) this.keep(withAxis(map, one.axis, axis.place, axis.isNegative), view);
    else if (one.button && button >= 0) this.keep(withButton(map, one.button, button), view);
  }

  /**
   * @param {PadMap} map
   * @param {PadView} view
   */
  keep(map, view) {
    this.learnt = null;
    this.ctx.pads.setMap(view.id, map);
  }
}

/**
 * @param {Part} one
 * @param {PadMap | null} map
 */
function placed({ axis, button }, map) {
  if (!map) return "—";
  if (button === undefined) return `${map.axes[axis] ?? "—"}${map.turned[axis] ? " ↔" : ""}`;
  const places = map[button];
  return Array.isArray(places) ? places.join(" / ") : String(places);
}
