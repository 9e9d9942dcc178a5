// @ts-check
/** @typedef {import("PATH-OF-TYPES").Context} Context */
/** @typedef {import("PATH-OF-TYPES").Instance} Instance */
import { attribute, noteOf, part, write } from "urc/kit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, send, signal, t }) {
    const root = part(el, ".NEW-WIDGET");
    const text = part(el, ".NEW-WIDGET-text");
    const unit = part(el, ".NEW-WIDGET-unit");
    const note = part(el, ".NEW-WIDGET-note");
    const button = el.querySelector("button");
    let isWaiting = false;

    async function press() {
      if (isWaiting) return;
      isWaiting = true;
      const answer = part(el, ".NEW-WIDGET-answer");
      write(answer, "…");
      try {
        await send("press");
        write(answer, "");
      } catch (error) {
        write(answer, `▲ ${error instanceof Error ? error.message : error}`);
      } finally {
        isWaiting = false;
      }
    }
    button?.addEventListener("click", press, { signal });

    return {
      update({ value }, { press: outlet }) {
        if (value) {
          attribute(root, "data-state", value.state);
          attribute(root, "data-alarm", value.alarm);
          write(text, value.text);
          write(unit, value.value === null ? "" : value.unit);
          write(note, noteOf(value, t));
        }
        if (outlet) attribute(button ?? root, "aria-disabled", outlet.isReady ? null : "true");
      },
    };
  },
};
