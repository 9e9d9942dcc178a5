// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/core/types.js").Value} Value */
import { CommandState, PendingValue } from "urc/command_kit";
import { attribute, noteOf, part, wordOf, write } from "urc/kit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const control = new Switch(ctx);
    return {
      update({ state, requested }, outputs) {
        control.update(state, requested, outputs);
      },
    };
  },
};

class Switch {
  /** @param {Context} ctx */
  constructor(ctx) {
    const { el, options, signal, t } = ctx;
    this.ctx = ctx;
    this.root = part(el, ".switch");
    this.note = part(el, ".switch-note");
    this.word = part(el, ".switch-word");
    this.main = el.querySelector(".switch-main");
    this.pair = el.querySelector(".switch-pair");
    this.isOptimistic = options["echo"] === "optimistic";
    this.words = [String(options["off_word"] ?? "off"), String(options["on_word"] ?? "on")];
    this.values = valuesOf(ctx);
    /** @type {Reading | undefined} */
    this.state = undefined;
    /** @type {Reading | undefined} */
    this.requested = undefined;
    const show = () => this.show();
    this.giver = new CommandState({ give: () => Promise.resolve(), show, t, signal });
    this.wish = new PendingValue({
      withinMs: 1000 * Number(options["echo_s"] ?? 3),
      show,
      signal,
      isSame: (wished, said) => this.isOn(said, this.state) === wished,
    });
    const tap = (/** @type {Element | null} */ button, /** @type {() => boolean} */ wanted) => {
      button?.addEventListener("click", () => void this.turn(wanted()), { signal });
    };
    tap(this.main, () => this.shown !== true);
    tap(el.querySelector(".switch-on"), () => true);
    tap(el.querySelector(".switch-off"), () => false);
  }

  /**
   * @param {Reading | undefined} state
   * @param {Reading | undefined} requested
   * @param {Readonly<Record<string, Outlet>>} outputs
   */
  update(state, requested, outputs) {
    this.state = state;
    this.requested = requested;
    this.wish.take(state);
    if (outputs["change"]) return this.giver.take(outputs["change"]);
    const [on, off] = [outputs["turn_on"], outputs["turn_off"]];
    this.giver.take(on && off ? { ...on, reason: on.reason || off.reason } : undefined);
  }

  /**
   * Return whether a value of a reading means on; null if it means neither on nor off.
   *
   * @param {unknown} said
   * @param {Reading | undefined} reading
   * @returns {boolean | null}
   */
  isOn(said, reading) {
    if (said === null || said === undefined) return null;
    const [off, on] = this.values.map((value) => wordOf(reading?.signal, value));
    if (String(said) === on) return true;
    if (String(said) === off) return false;
    if (typeof said === "boolean") return said;
    return typeof said === "number" && this.values[1] === true ? said !== 0 : null;
  }

  /** Displayed state: the requested state if the option is set so, otherwise the robot's state. */
  get shown() {
    if (this.isOptimistic && this.wish.isWaiting) return this.wish.value === true;
    return this.isOn(this.state?.value, this.state);
  }

  /** Requested state, for robots that do not report their state; null if unknown. */
  get asked() {
    return this.isOn(this.requested?.value, this.requested);
  }

  /**
   * Return the note below the switch.
   *
   * @param {string} missed text about a requested state that the robot did not reach, or ""
   */
  noteWith(missed) {
    const { giver, state, requested } = this;
    const { t } = this.ctx;
    if (state) return giver.note(missed, noteOf(state, t));
    if (this.asked === null) return giver.note() || t("unknown");
    return giver.note() || [t("requested"), requested ? noteOf(requested, t) : ""].filter(Boolean).join(" · ");
  }

  /** @param {boolean} isOn */
  async turn(isOn) {
    if (!this.giver.isReady || this.giver.isPending) return;
    const { ctx } = this;
    const isOne = ctx.command("change") !== null;
    this.giver.give = () =>
      isOne ? ctx.send("change", { value: this.values[isOn ? 1 : 0] ?? isOn }) : ctx.send(isOn ? "turn_on" : "turn_off");
    if (this.state) this.wish.make(isOn, this.state);
    this.show();
    if (!(await this.giver.once())) {
      this.wish.drop();
      this.show();
    }
  }

  show() {
    const { giver, wish, state, words, shown } = this;
    const isKnown = this.isOn(state?.value, state) !== null;
    const isLocked = !giver.isReady || giver.isPending;
    attribute(this.root, "data-state", state?.state ?? "unreported");
    attribute(this.root, "data-asked", this.asked === null ? "no" : "yes");
    attribute(this.root, "data-alarm", state?.alarm ?? "");
    attribute(this.root, "data-phase", giver.phase);
    attribute(this.root, "data-wish", wish.isMissed ? "missed" : wish.isWaiting ? "waiting" : "");
    if (this.main instanceof HTMLElement && this.pair instanceof HTMLElement) {
      const hadFocus = this.main.contains(document.activeElement) || this.pair.contains(document.activeElement);
      const isMoved = this.main.hidden === isKnown;
      this.main.hidden = !isKnown;
      this.pair.hidden = isKnown;
      if (hadFocus && isMoved) (isKnown ? this.main : this.pair.querySelector("button"))?.focus();
      attribute(this.main, "aria-checked", String(shown === true));
      for (const button of [this.main, ...this.pair.children]) attribute(button, "aria-disabled", String(isLocked));
      for (const [place, button] of this.requested ? [...this.pair.children].entries() : []) {
        attribute(button, "aria-pressed", String(this.asked === (place === 1)));
      }
    }
    const sign = wish.isWaiting ? " …" : wish.isMissed ? " ≠" : "";
    write(this.word, (isKnown ? words[shown ? 1 : 0] ?? "" : state?.text ?? "—") + sign);
    const wished = words[wish.value === true ? 1 : 0] ?? "";
    const missed = wish.isMissed ? this.ctx.t("≠ requested {wish}; the robot reports another value", { wish: wished }) : "";
    write(this.note, this.noteWith(missed));
  }
}

/**
 * Return the values of off and on.
 *
 * @param {Context} ctx
 * @returns {Value[]}
 */
function valuesOf({ command, options }) {
  const argument = Object.values(command("change")?.arguments ?? {})[0];
  const choices = argument?.choices ?? [];
  /** @type {Value[]} */
  let usual = [false, true];
  if (argument?.type === "integer" || argument?.type === "number") usual = [0, 1];
  if (argument?.type === "string") usual = ["off", "on"];
  if (choices.length === 2) usual = [choices[0] ?? null, choices[1] ?? null];
  const own = [options["off_value"], options["on_value"]];
  const isNumber = argument?.type === "integer" || argument?.type === "number";
  return usual.map((value, place) => {
    const given = own[place];
    if (typeof given !== "string") return value;
    return isNumber ? Number(given) : argument?.type === "boolean" ? given === "true" : given;
  });
}
