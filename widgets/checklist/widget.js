// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { CommandState } from "urc/command_kit";
import { attribute, part, write } from "urc/kit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, signal, send, memory, command, t }) {
    const root = part(el, ".checklist");
    const note = part(el, ".checklist-note");
    const done = el.querySelector(".checklist-done");
    const isAutomatic = options["automatic"] === true;
    const hasCommand = command("complete") !== null;
    const giver = new CommandState({ give: () => send("complete"), show, t, signal });
    if (!hasCommand) giver.reason = "";
    /** Ticked items, stored by text, so that ticks do not move to other items if the list changes. */
    const kept = memory.read();
    const known = new Set(Array.isArray(kept) ? kept.map(String) : []);
    const boxes = [...el.querySelectorAll(".checklist-item")].map((item) => {
      const label = document.createElement("label");
      label.className = "checklist-item";
      const box = document.createElement("input");
      box.type = "checkbox";
      box.className = "checklist-box";
      const text = document.createElement("span");
      text.textContent = item.textContent;
      box.checked = known.has(text.textContent ?? "");
      label.append(box, text);
      item.replaceWith(label);
      return { box, text: text.textContent ?? "" };
    });

    function show() {
      const count = boxes.filter(({ box }) => box.checked).length;
      const isAll = count === boxes.length;
      attribute(root, "data-state", isAll ? "complete" : "none");
      attribute(root, "data-phase", giver.phase);
      if (done) attribute(done, "aria-disabled", String(!isAll || !giver.isReady || giver.isPending));
      const figure = t("{count} of {all}", { count, all: boxes.length });
      const words = isAll ? `✓ ${t("all done")}` : figure;
      write(note, giver.note(words));
    }

    function keep() {
      memory.write(boxes.filter(({ box }) => box.checked).map(({ text }) => text));
      show();
    }

    el.addEventListener("change", () => {
      keep();
      const isAll = boxes.every(({ box }) => box.checked);
      if (isAll && isAutomatic && hasCommand) void giver.once();
    }, { signal });
    done?.addEventListener("click", () => {
      if (boxes.every(({ box }) => box.checked)) void giver.once();
    }, { signal });
    el.querySelector(".checklist-again")?.addEventListener("click", () => {
      for (const { box } of boxes) box.checked = false;
      giver.become("");
      keep();
    }, { signal });
    show();
    return {
      update(_, { complete }) {
        if (hasCommand) giver.take(complete);
      },
    };
  },
};
