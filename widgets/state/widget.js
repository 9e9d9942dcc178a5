// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { attribute, clamp, keyOf, noteOf, part, style, write } from "urc/kit";

/** Common shapes of all widgets: triangle for alarm, diamond for caution, square for advice. */
const SHAPES = {
  unknown: "◌",
  plain: "◎",
  off: "○",
  on: "●",
  advice: "■",
  caution: "◆",
  alarm: "▲",
  busy: "◐",
};

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, t }) {
    const root = part(el, ".state");
    const shape = part(el, ".state-shape");
    const text = part(el, ".state-text");
    const note = part(el, ".state-note");

    return {
      update({ value }) {
        if (!value) return;
        const meaning = meaningOf(value, options["meanings"]);
        const word = wordOf(value, options["words"], t);
        attribute(root, "data-state", value.state);
        attribute(root, "data-alarm", value.alarm);
        attribute(root, "data-meaning", meaning);
        // In steps of two characters, so that a new word rarely changes the font size.
        style(root, "--state-characters", String(clamp(2 * Math.ceil(word.length / 2), 4, 40)));
        write(shape, SHAPES[meaning]);
        write(text, word);
        write(note, noteOf(value, t));
      },
    };
  },
};

/**
 * @param {Reading} reading
 * @param {unknown} meanings
 * @returns {keyof typeof SHAPES}
 */
function meaningOf({ value, signal }, meanings) {
  if (value === null) return "unknown";
  const said = entry(meanings, value, signal);
  if (said !== undefined && Object.hasOwn(SHAPES, said)) return /** @type {keyof typeof SHAPES} */ (said);
  if (typeof value === "boolean") return value ? "on" : "off";
  return "plain";
}

/**
 * @param {Reading} reading
 * @param {unknown} words
 * @param {Context["t"]} t
 */
function wordOf({ value, text, signal }, words, t) {
  if (value === null) return text;
  const said = entry(words, value, signal);
  if (said !== undefined) return said;
  if (typeof value === "boolean" && text === String(value)) return value ? t("on") : t("off");
  return text;
}

/**
 * Return a table's entry for a value, by its displayed word or by the robot's own value.
 *
 * @param {unknown} table
 * @param {unknown} value
 * @param {Reading["signal"]} signal
 */
function entry(table, value, signal) {
  if (typeof table !== "object" || table === null) return undefined;
  const key = [String(value), keyOf(signal, value)].find((each) => Object.hasOwn(table, each));
  return key === undefined ? undefined : String(/** @type {Record<string, unknown>} */ (table)[key]);
}
