// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/core/types.js").Value} Value */
import { CommandState, PendingValue } from "urc/command_kit";
import { DASH, attribute, noteOf, part, wordOf, write } from "urc/kit";

/** @typedef {{value: Value, label: string}} Choice */

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const control = new Select(ctx);
    return {
      update({ state }, { change }) {
        control.update(state, change);
      },
    };
  },
};

class Select {
  /** @param {Context} ctx */
  constructor(ctx) {
    const { el, options, signal, t, onStop, memory } = ctx;
    this.ctx = ctx;
    this.root = part(el, ".select");
    this.now = part(el, ".select-now");
    this.note = part(el, ".select-note");
    this.place = el.querySelector(".select-choices");
    this.isOptimistic = options["echo"] === "optimistic";
    this.isList = options["look"] === "list";
    /** @type {Reading | undefined} */
    this.state = undefined;
    /** @type {Choice[]} */
    this.choices = [];
    this.made = "";
    /** @type {Value} */
    this.chosen = null;
    /** Last sent value, shown if no state is bound. @type {unknown} */
    this.last = memory.read();
    const show = () => this.show();
    this.giver = new CommandState({ give: (args) => this.give(args), show, t, signal, onStop });
    this.wish = new PendingValue({
      withinMs: 1000 * Number(options["echo_s"] ?? 3),
      show,
      signal,
      isSame: (wished, said) => this.choices[this.placeOf(String(said))]?.value === wished || this.word(wished) === String(said),
    });
    this.place?.addEventListener("change", (event) => {
      const at = event.target;
      if (at instanceof HTMLSelectElement) this.choose(this.choices[Number(at.value)]);
      if (at instanceof HTMLInputElement) this.choose(this.choices[Number(at.value)]);
    }, { signal });
  }

  /** Return the robot's word for a value. @param {Value} value */
  word(value) {
    return wordOf(this.state?.signal, value);
  }

  /**
   * Return the index of the choice that the robot reports; -1 if there is none. A robot that reports
   * text may take numbers: then the label of a choice is the robot's text.
   *
   * @param {string | null} said
   */
  placeOf(said) {
    const place = this.choices.findIndex(({ value }) => this.word(value) === said);
    if (place >= 0 || typeof this.state?.value !== "string") return place;
    return this.choices.findIndex(({ label }) => label === said);
  }

  /**
   * @param {Reading | undefined} state
   * @param {Outlet | undefined} change
   */
  update(state, change) {
    this.state = state;
    this.wish.take(state);
    this.choices = choicesOf(this.ctx, state);
    const look = JSON.stringify(this.choices);
    if (this.place && look !== this.made) {
      this.made = look;
      this.place.replaceChildren(...(this.isList ? [this.list()] : this.choices.map((_, place) => this.radio(place))));
    }
    this.giver.take(change);
  }

  /** Send a choice, or queue it during a pending command. @param {Choice | undefined} choice */
  choose(choice) {
    if (choice && this.giver.isReady) {
      this.chosen = choice.value;
      this.giver.newest({ value: choice.value });
    }
    this.show();
  }

  /** @param {Record<string, Value>} args */
  async give(args) {
    if (this.state) this.wish.make(args["value"] ?? null, this.state);
    this.show();
    try {
      await this.ctx.send("change", args);
    } catch (error) {
      this.wish.drop();
      throw error;
    }
    if (this.state) return;
    this.last = args["value"] ?? null;
    this.ctx.memory.write(this.last);
    this.show();
  }

  show() {
    const { giver, wish, state, ctx } = this;
    const isHoped = this.isOptimistic && wish.isWaiting;
    const said = state && state.value !== null ? String(state.value) : null;
    const shown = isHoped ? this.word(wish.value) : said;
    attribute(this.root, "data-state", state?.state ?? "none");
    attribute(this.root, "data-alarm", state?.alarm ?? "");
    attribute(this.root, "data-phase", giver.phase);
    attribute(this.root, "data-wish", wish.isMissed ? "missed" : wish.isWaiting ? "waiting" : "");
    // The last sent value is shown as text only: the list stays free, so that it can be sent again.
    const known = state || this.last === null ? shown : String(this.last);
    const now = this.choices[this.placeOf(known)];
    const sign = wish.isWaiting ? " …" : wish.isMissed ? " ≠" : "";
    write(this.now, (now?.label ?? state?.text ?? DASH) + sign);
    this.mark(shown, !giver.isReady);
    const wished = this.choices.find(({ value }) => value === wish.value)?.label ?? "";
    const missed = wish.isMissed ? ctx.t("≠ requested {wish}; the robot reports another value", { wish: wished }) : "";
    write(this.note, giver.note(missed, state ? noteOf(state, ctx.t) : ""));
  }

  /**
   * @param {string | null} shown
   * @param {boolean} isLocked
   */
  mark(shown, isLocked) {
    const place = this.placeOf(shown);
    const list = this.place?.querySelector("select");
    if (list) {
      // A reported value that cannot be chosen is shown too.
      const other = list.options[0];
      if (other) write(other, place < 0 && this.state && shown !== null ? this.state.text : "—");
      // During a pending command, the operator's selection stays, so that the next arrow key continues there.
      const isAsked = this.giver.isPending || this.giver.next !== null;
      const wished = isAsked ? this.chosen : this.wish.isWaiting ? this.wish.value : null;
      const hand = wished === null ? place : this.choices.findIndex(({ value }) => value === wished);
      if (list.value !== String(hand)) list.value = String(hand);
      lock(list, isLocked);
    }
    for (const radio of this.place?.querySelectorAll("input") ?? []) {
      const isOne = radio.value === String(place);
      if (radio.checked !== isOne) radio.checked = isOne;
      lock(radio, isLocked);
      const isWished = this.wish.value !== null && this.choices[Number(radio.value)]?.value === this.wish.value;
      attribute(radio.parentElement ?? radio, "data-wished", isWished ? "true" : null);
    }
  }

  list() {
    const list = document.createElement("select");
    list.className = "select-list urc-act";
    list.setAttribute("aria-labelledby", `${this.root.dataset["uid"]}-title`);
    list.setAttribute("aria-describedby", `${this.root.dataset["uid"]}-note`);
    const none = new Option("—", "-1");
    none.disabled = true;
    list.append(none, ...this.choices.map(({ label }, place) => new Option(label, String(place))));
    return list;
  }

  /** @param {number} place */
  radio(place) {
    const label = document.createElement("label");
    label.className = "select-choice";
    const input = document.createElement("input");
    input.className = "select-radio";
    input.type = "radio";
    input.name = `${this.root.dataset["uid"]}-choice`;
    input.value = String(place);
    const text = document.createElement("span");
    text.textContent = this.choices[place]?.label ?? "";
    label.append(input, text);
    return label;
  }
}

/**
 * Disable a control unless it has the focus: otherwise, the page would get the focus and the next key.
 * Choices during this time are refused.
 *
 * @param {HTMLSelectElement | HTMLInputElement} control
 * @param {boolean} isLocked
 */
function lock(control, isLocked) {
  const isOff = isLocked && document.activeElement !== control;
  if (control.disabled !== isOff) control.disabled = isOff;
  attribute(control, "aria-disabled", String(isLocked));
}

/**
 * Return the choices of the slot, the command or the signal, in this order of preference.
 *
 * @param {Context} ctx
 * @param {Reading | undefined} state
 * @returns {Choice[]}
 */
function choicesOf({ command, options }, state) {
  const argument = Object.values(command("change")?.arguments ?? {})[0];
  const states = state?.signal.states ?? {};
  const label = (/** @type {Value} */ value) =>
    Object.hasOwn(states, String(value)) ? (states[String(value)] ?? "") : String(value);
  const own = options["choices"];
  /** @type {Choice[]} */
  let found = (argument?.choices ?? []).map((value) => ({ value, label: label(value) }));
  if (found.length === 0) found = Object.keys(states).map((value) => ({ value, label: label(value) }));
  if (found.length === 0 && argument?.type === "boolean") {
    found = [false, true].map((value) => ({ value, label: label(value) }));
  }
  if (Array.isArray(own)) {
    found = own.map((text) => {
      const [value, ...rest] = String(text).split("=");
      return { value: value ?? "", label: rest.length > 0 ? rest.join("=") : label(value ?? "") };
    });
  }
  return found.map((one) => ({ ...one, value: typed(one.value, argument?.type) }));
}

/**
 * @param {Value} value
 * @param {string | undefined} type
 * @returns {Value}
 */
function typed(value, type) {
  if (typeof value !== "string") return value;
  if (type === "integer" || type === "number") return Number(value);
  return type === "boolean" ? value === "true" : value;
}
