// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").LogLine} LogLine */
import { attribute, clock, part, save, write } from "urc/kit";
import { chosen, fileOf } from "./lines.js";

const SIGNS = { info: "", warning: "◆", error: "▲" };
/** Distance from the end within which the log follows new lines. */
const NEAR_PX = 24;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, signal, follow, t }) {
    const list = part(el, ".log-lines");
    const note = part(el, ".log-note");
    const pause = part(el, ".log-pause");
    const level = /** @type {HTMLSelectElement} */ (part(el, ".log-level"));
    const filter = /** @type {HTMLInputElement} */ (part(el, ".log-filter"));
    const most = Number(options["lines"] ?? 200);
    /** @type {readonly LogLine[]} */
    let lines = [];
    let missing = 0;
    /** Lines of a paused log. @type {readonly LogLine[] | null} */
    let held = null;
    let shown = "";

    function show() {
      const wanted = chosen(held ?? lines, { level: level.value, words: filter.value, most });
      const look = `${level.value} ${filter.value} ${wanted.at(0)?.number} ${wanted.at(-1)?.number} ${wanted.length} ${wanted.at(-1)?.time}`;
      if (look !== shown) {
        shown = look;
        draw(wanted);
      }
      const newer = held ? lines.length - held.length : 0;
      const last = held?.at(-1)?.number ?? -1;
      const waiting = held ? lines.filter(({ number }) => number > last).length : newer;
      const words = [
        held ? t("◆ paused; {count} newer", { count: waiting }) : "",
        missing > 0 ? t("{count} lines were lost", { count: missing }) : "",
        wanted.length === 0 ? `— ${lines.length > 0 ? t("no line matches") : t("no line yet")}` : "",
      ];
      write(note, words.filter(Boolean).join(" · "));
      attribute(pause, "aria-pressed", String(held !== null));
      write(pause, held ? t("Continue") : t("Pause"));
    }

    /** @param {LogLine[]} wanted */
    function draw(wanted) {
      const isAtEnd = list.scrollHeight - list.scrollTop - list.clientHeight < NEAR_PX;
      const before = new Map([...list.children].map((item) => [item.getAttribute("data-key"), item]));
      list.replaceChildren(...wanted.map((line) => before.get(keyOf(line)) ?? itemOf(line)));
      if (isAtEnd) list.scrollTop = list.scrollHeight;
    }

    follow("log", (news) => {
      lines = [...news.lines];
      missing = news.missing;
      show();
    });
    level.addEventListener("change", show, { signal });
    filter.addEventListener("input", show, { signal });
    filter.addEventListener("keydown", (event) => {
      if (event.key === "Escape" && filter.value) event.preventDefault(); // Escape clears the field
    }, { signal });
    pause.addEventListener("click", () => {
      held = held ? null : lines;
      show();
    }, { signal });
    part(el, ".log-save").addEventListener("click", () => {
      const wanted = chosen(held ?? lines, { level: level.value, words: filter.value, most: Infinity });
      save(fileOf(wanted), "log.tsv", "text/tab-separated-values");
    }, { signal });
    return {};
  },
};

/** @param {LogLine} line */
function keyOf({ number, time }) {
  return `${number} ${time}`;
}

/** @param {LogLine} line */
function itemOf(line) {
  const { time, level, source, text } = line;
  const item = document.createElement("li");
  item.dataset["key"] = keyOf(line);
  item.dataset["level"] = level;
  const when = document.createElement("span");
  when.className = "log-time";
  when.textContent = clock(new Date(time));
  const sign = document.createElement("span");
  sign.className = "log-sign";
  sign.textContent = SIGNS[level] ?? "";
  item.append(when, " ", sign, ` ${source}: ${text}`);
  return item;
}
