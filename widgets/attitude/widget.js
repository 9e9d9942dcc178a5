// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/types.js").Reading} Reading */
/** @typedef {import("./angles.js").Angles} Angles */
/** @typedef {import("./angles.js").Lean} Lean */
import { attribute, noteOf, number, numbers, part, worst, write } from "urc/kit";
import { DEGREES, leanOf, ofQuaternion } from "./angles.js";
import { viewOf } from "./views.js";

/** From this share of a limit on it is a caution. */
const NEAR = 0.8;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, t }) {
    const root = part(el, ".attitude");
    const words = part(el, ".attitude-words");
    const note = part(el, ".attitude-note");
    const view = viewOf(el, options);
    const axes = (/** @type {(Reading | undefined)[]} */ readings) =>
      String(options["axes"] ?? readings.find((reading) => reading?.signal.axes)?.signal.axes ?? "FLU");

    return {
      update({ orientation, roll, pitch, yaw }) {
        const angles = orientation
          ? ofQuaternion(numbers(orientation) ?? [], String(options["order"]))
          : { roll: radians(roll), pitch: radians(pitch), yaw: radians(yaw) };
        const lean = leanOf(angles ?? { roll: null, pitch: null, yaw: null }, axes([orientation, roll, pitch, yaw]));
        const isKnown = lean.bank !== null || lean.nose !== null || lean.turn !== null;
        const all = worst([orientation, roll, pitch, yaw]);
        const reading = isKnown || all.state !== "live" ? all : { ...all, state: /** @type {const} */ ("none") };
        const own = passed(lean, options);
        attribute(root, "data-state", reading.state);
        attribute(root, "data-alarm", own ? (own.isAlarm ? "hihi" : "high") : reading.alarm);
        attribute(root, "data-known", isKnown ? "yes" : "no");
        view.show(lean);
        write(words, wordsOf(lean, t));
        const said = own ? (own.isAlarm ? t("▲ Leans too far") : t("◆ Leans far")) : "";
        write(note, [said, noteOf(reading, t)].filter(Boolean).join(" · "));
      },
    };
  },
};

/**
 * @param {Reading | undefined} reading
 * @returns {number | null}
 */
function radians(reading) {
  const value = number(reading);
  if (value === null) return null;
  return reading?.signal.unit === "rad" ? value : value / DEGREES;
}

/**
 * @param {Lean} lean
 * @param {Readonly<Record<string, unknown>>} options
 * @returns {{isAlarm: boolean} | null}
 */
function passed({ bank, nose }, options) {
  const shares = [[bank, options["roll_limit"]], [nose, options["pitch_limit"]]].map(([angle, limit]) =>
    typeof angle === "number" && typeof limit === "number" ? Math.abs(angle) / limit : 0,
  );
  const most = Math.max(...shares);
  return most >= NEAR ? { isAlarm: most >= 1 } : null;
}

/**
 * Say how it leans so that no convention has to be known.
 *
 * @param {Lean} lean
 * @param {Context["t"]} t
 */
function wordsOf({ bank, nose }, t) {
  const said = [];
  if (nose !== null) {
    const degrees = Math.abs(Math.round(nose));
    if (degrees > 0) said.push(nose > 0 ? t("nose up {degrees}°", { degrees }) : t("nose down {degrees}°", { degrees }));
  }
  if (bank !== null) {
    const degrees = Math.abs(Math.round(bank));
    if (degrees > 0) said.push(bank > 0 ? t("right side down {degrees}°", { degrees }) : t("left side down {degrees}°", { degrees }));
  }
  if (said.length > 0) return said.join(", ");
  return bank === null && nose === null ? "—" : t("level");
}
