// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").LogLine} LogLine */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { CommandState } from "urc/command_kit";
import { attribute, noteOf, part, write } from "urc/kit";
import { hexOf, pairsOf, plain, Typed } from "./hex.js";
import { Screen } from "./screen.js";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, signal, send, each, follow, memory, command, t } = ctx;
    const root = part(el, ".terminal");
    const note = part(el, ".terminal-note");
    const field = el.querySelector(".terminal-field");
    const screen = new Screen(ctx, part(el, ".terminal-screen"));
    const typed = new Typed(memory.read());
    const isHex = options["hex"] === true;
    const hasCommand = command("typed") !== null;
    const argument = Object.values(command("typed")?.arguments ?? {})[0];
    let fault = "";
    /** @type {Reading | undefined} */
    let state;
    const giver = new CommandState({ give: (args) => send("typed", args), show, t, signal });
    if (!hasCommand) giver.reason = "";

    function show() {
      attribute(root, "data-state", state?.state ?? "none");
      attribute(root, "data-phase", giver.phase);
      write(note, [fault, giver.note(state ? noteOf(state, t) : "")].filter(Boolean).join(" · ") || "—");
      if (!field) return;
      attribute(field, "aria-invalid", fault ? "true" : null);
      attribute(part(root, ".terminal-send"), "aria-disabled", String(!giver.isReady || giver.isPending));
    }

    /** @param {string} text */
    function heard(text) {
      screen.write(`< ${plain(text)}${isHex ? `   [${hexOf(text)}]` : ""}`);
    }

    if (field instanceof HTMLInputElement) {
      part(root, ".terminal-row").addEventListener("submit", async (event) => {
        event.preventDefault();
        const line = lineOf(field.value);
        if (line !== null && giver.isReady && !giver.isPending) {
          typed.add(field.value);
          memory.write(typed.lines);
          screen.write(`> ${plain(line)}`);
          const before = field.value;
          if ((await giver.once({ value: line })) && field.value === before) field.value = "";
          if (giver.phase === "failed") screen.write(`! ${plain(giver.outcome)}`);
        }
        show();
      }, { signal });
      field.addEventListener("input", () => {
        fault = "";
        show();
      }, { signal });
      field.addEventListener("keydown", (event) => {
        if (event.key !== "ArrowUp" && event.key !== "ArrowDown") return;
        event.preventDefault();
        field.value = typed.go(event.key === "ArrowUp" ? -1 : 1, field.value);
        field.setSelectionRange(field.value.length, field.value.length);
      }, { signal });
    }

    /**
     * @param {string} text
     * @returns {string | null} the line to send; null if it is invalid
     */
    function lineOf(text) {
      fault = "";
      if (isHex) {
        const pairs = pairsOf(text);
        if ("value" in pairs) return pairs.value;
        const words = {
          empty: t("◆ type bytes, such as 06 05 FF"),
          odd: t("◆ a digit is missing: each byte has two digits"),
          letters: t("◆ use only the digits 0 to 9 and A to F"),
          long: t("◆ too many bytes"),
        };
        fault = words[pairs.fault];
        return null;
      }
      if (text === "") fault = t("◆ type a line");
      else if (!argument?.allowsControl && /\p{Cc}/u.test(text)) fault = t("◆ control characters are not allowed");
      return fault ? null : text;
    }

    /** Last shown line of the log. @type {LogLine | undefined} */
    let last;
    let isBound = false;
    follow("log", ({ lines }) => {
      if (isBound) return;
      const from = last ? lines.indexOf(last) + 1 : 0;
      for (const line of lines.slice(from)) screen.write(`${line.source}: ${plain(line.text)}`);
      last = lines.at(-1);
    });
    each("line", ({ value }, missed) => {
      if (missed > 0) screen.write(t("… lines omitted: {count}", { count: missed }));
      if (value !== null) heard(String(value));
    });
    return {
      update(readings, outputs) {
        state = readings["line"];
        isBound = state !== undefined;
        if (hasCommand) giver.take(outputs["typed"]);
        else show();
      },
      resize() {
        screen.fit?.();
      },
    };
  },
};
