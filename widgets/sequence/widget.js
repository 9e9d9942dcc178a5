// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { attribute, noteOf, number, part, write } from "urc/kit";
import { OwnList, RobotSequence } from "./runs.js";

const SIGNS = { todo: "○", now: "▶", done: "✓", failed: "▲" };

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, signal, t } = ctx;
    const root = part(el, ".sequence");
    const note = part(el, ".sequence-note");
    const place = el.querySelector(".sequence-steps");
    if (!(place instanceof HTMLElement)) return {};
    const list = place;
    const isEach = options["confirm_each"] === true;
    const run = ctx.command("run") ? new RobotSequence(ctx, isEach, show) : new OwnList(ctx, isEach, show);
    const own = Array.isArray(options["steps"]) ? options["steps"].map(String) : [];
    const names = run.names.map((name, index) => own[index] ?? name);
    // Names beyond the known steps are shown too.
    names.push(...own.slice(names.length));
    const items = names.map((name) => {
      const item = document.createElement("li");
      const sign = document.createElement("span");
      sign.className = "sequence-sign";
      const text = document.createElement("span");
      text.textContent = name;
      item.append(sign, " ", text);
      return { item, sign };
    });
    list.replaceChildren(...items.map(({ item }) => item));
    /** @type {Reading | undefined} */
    let progress;
    let shown = -1;

    function show() {
      const { place, state, isFailed } = run;
      const said = progress ? number(progress) : null;
      const at = progress && state === "idle" ? (said ?? 0) + 1 : place;
      const isOver = state === "idle" && !isFailed;
      items.forEach(({ item, sign }, index) => {
        const isDone = index + 1 < at || (isOver && !progress && run.isDone);
        const isNow = index + 1 === at && state !== "idle";
        const kind = isDone ? "done" : index + 1 === at && isFailed ? "failed" : isNow ? "now" : "todo";
        attribute(item, "data-step", kind);
        attribute(item, "aria-current", isNow ? "step" : null);
        write(sign, SIGNS[kind]);
        if (isNow && shown !== index) {
          shown = index;
          item.scrollIntoView({ block: "nearest" });
        }
      });
      attribute(root, "data-state", state);
      attribute(root, "data-phase", isFailed ? "failed" : "");
      const isBusy = state !== "idle";
      const button = (/** @type {string} */ name, /** @type {boolean} */ isShown) => {
        const found = part(root, `.sequence-${name}`);
        if (found.hidden === isShown) found.hidden = !isShown;
      };
      button("start", !isBusy);
      button("next", state === "paused");
      button("pause", state === "running" && !isEach);
      button("resume", state === "paused" && !isEach);
      button("abort", isBusy);
      attribute(part(root, ".sequence-start"), "aria-disabled", String(run.reason !== ""));
      const words = { idle: "", running: t("step {place} of {of}", { place, of: run.of }), paused: t("paused before step {place} of {of}", { place: Math.min(place + 1, run.of), of: run.of }) }[state];
      write(note, [run.outcome, words, run.reason && !isBusy ? `◆ ${run.reason}` : "", progress ? noteOf(progress, t) : ""].filter(Boolean).join(" · ") || "—");
    }

    const on = (/** @type {string} */ name, /** @type {() => void} */ act) => {
      part(root, `.sequence-${name}`).addEventListener("click", act, { signal });
    };
    on("start", () => {
      if (run.reason === "" && run.state === "idle") run.start();
    });
    on("next", () => run.step());
    on("pause", () => run.pause());
    on("resume", () => run.resume());
    on("abort", () => run.abort());
    return {
      update(readings, outputs) {
        progress = readings["progress"];
        run.take(outputs);
        show();
      },
      destroy() {
        run.end();
      },
    };
  },
};
