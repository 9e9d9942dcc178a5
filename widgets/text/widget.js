// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { CommandState, PendingValue } from "urc/command_kit";
import { attribute, noteOf, part, write } from "urc/kit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, signal, send, command, t }) {
    const root = part(el, ".text");
    const text = part(el, ".text-text");
    const note = part(el, ".text-note");
    const field = el.querySelector(".text-field");
    const argument = Object.values(command("change")?.arguments ?? {})[0];
    const isOptimistic = options["echo"] === "optimistic";
    let fault = "";
    /** @type {Reading | undefined} */
    let state;
    const giver = new CommandState({ give: (args) => send("change", args), show, t, signal });
    const wish = new PendingValue({ withinMs: 1000 * Number(options["echo_s"] ?? 3), show, signal });

    function show() {
      const isHoped = isOptimistic && wish.isWaiting;
      attribute(root, "data-state", state?.state ?? "none");
      attribute(root, "data-alarm", state?.alarm ?? "");
      attribute(root, "data-phase", giver.phase);
      attribute(root, "data-wish", wish.isMissed ? "missed" : wish.isWaiting ? "waiting" : "");
      const sign = wish.isWaiting ? " …" : wish.isMissed ? " ≠" : "";
      write(text, (isHoped ? String(wish.value) : (state?.text ?? "—")) + sign);
      const missed = wish.isMissed ? t("≠ requested {wish}; the robot reports another value", { wish: String(wish.value) }) : "";
      write(note, [fault, giver.note(missed, state ? noteOf(state, t) : "")].filter(Boolean).join(" · "));
      if (!field) return;
      attribute(field, "aria-invalid", fault ? "true" : null);
      attribute(part(root, ".text-set"), "aria-disabled", String(!giver.isReady || giver.isPending));
    }

    if (field instanceof HTMLInputElement) {
      const list = part(root, "datalist");
      list.append(...(argument?.choices ?? []).map((choice) => new Option(String(choice), String(choice))));
      part(root, ".text-row").addEventListener("submit", async (event) => {
        event.preventDefault();
        const value = field.value;
        fault = faultOf(value);
        if (!fault && giver.isReady && !giver.isPending) {
          if (state) wish.make(value, state);
          show();
          if (!(await giver.once({ value }))) wish.drop();
          else if (options["keep"] !== true && field.value === value) field.value = "";
        }
        show();
      }, { signal });
      field.addEventListener("input", () => {
        fault = faultOf(field.value, true);
        show();
      }, { signal });
    }

    /**
     * @param {string} value
     * @param {boolean} isTyping whether an empty field is valid for now
     */
    function faultOf(value, isTyping = false) {
      if (value === "" && !isTyping) return t("◆ type some text");
      if (!argument?.allowsControl && /\p{Cc}/u.test(value)) return t("◆ control characters are not allowed");
      const choices = argument?.choices ?? [];
      const isOne = choices.length === 0 || choices.some((choice) => String(choice) === value);
      return isOne || isTyping ? "" : t("◆ one of: {choices}", { choices: choices.join(", ") });
    }

    return {
      update(readings, { change }) {
        state = readings["state"];
        wish.take(state);
        giver.take(change);
      },
    };
  },
};
