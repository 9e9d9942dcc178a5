// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./angles.js").Angles} Angles */
/** @typedef {import("./angles.js").Lean} Lean */
import { attribute, mark, noteOf, number, numbers, part, worst, write } from "urc/kit";
import { DEGREES, leanOf, ofQuaternion } from "./angles.js";
import { Height } from "./height.js";
import { viewOf } from "./views.js";

/** Fraction of a limit at which a caution begins. */
const NEAR = 0.8;
/** Names of the angles. */
const NAMES = { bank: mark("roll"), nose: mark("pitch"), turn: mark("yaw") };

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t } = ctx;
    const root = part(el, ".attitude");
    const words = part(el, ".attitude-words");
    const note = part(el, ".attitude-note");
    const view = viewOf(el, options);
    const tape = el.querySelector(".attitude-tape") ? new Height(ctx) : null;
    const parts = partsOf(options["view"]);
    const axes = (/** @type {(Reading | undefined)[]} */ readings) =>
      String(options["axes"] ?? readings.find((reading) => reading?.signal.axes)?.signal.axes ?? "FLU");

    return {
      update({ orientation, roll, pitch, yaw, height }) {
        const angles = orientation
          ? ofQuaternion(numbers(orientation) ?? [], String(options["order"]))
          : { roll: radians(roll), pitch: radians(pitch), yaw: radians(yaw) };
        const lean = leanOf(angles ?? { roll: null, pitch: null, yaw: null }, axes([orientation, roll, pitch, yaw]));
        const bound = orientation
          ? { bank: orientation, nose: orientation, turn: orientation }
          : { bank: roll, nose: pitch, turn: yaw };
        const known = parts.filter((name) => lean[name] !== null);
        const missing = parts.filter((name) => lean[name] === null && (bound[name] || known.length === 0));
        const reading = readingOf(known.map((name) => bound[name]), [orientation, roll, pitch, yaw]);
        const own = passed(lean, options);
        attribute(root, "data-state", reading.state);
        attribute(root, "data-alarm", own ? (own.isAlarm ? "hihi" : "high") : reading.alarm);
        attribute(root, "data-missing", missing.join(" "));
        view.show(lean);
        tape?.show(height);
        write(words, wordsOf(lean, missing, t));
        const said = own ? (own.isAlarm ? t("▲ Leans too far") : t("◆ Leans far")) : "";
        const lost = known.length > 0 ? missing.map((name) => `${t(NAMES[name])}: ${lossOf(bound[name], t)}`) : [];
        const old = tape && height && height.state !== "live" ? `${t("height")}: ${noteOf({ ...height, alarm: "" }, t)}` : "";
        write(note, [said, noteOf(reading, t), ...lost, old].filter(Boolean).join(" · "));
      },
    };
  },
};

/**
 * Return the angles that a view draws.
 *
 * @param {unknown} view
 * @returns {readonly (keyof Lean)[]}
 */
function partsOf(view) {
  return view === "solid" || view === "axes" ? ["bank", "nose", "turn"] : ["bank", "nose"];
}

/**
 * Return the state of the shown readings or, without shown readings, of all bound readings.
 *
 * @param {readonly (Reading | undefined)[]} known
 * @param {readonly (Reading | undefined)[]} all
 */
function readingOf(known, all) {
  const { state, age, alarm } = worst(all);
  if (known.length > 0) return { ...worst(known), alarm };
  return { state: state === "live" ? /** @type {const} */ ("none") : state, age, alarm };
}

/**
 * Return why an angle is unknown.
 *
 * @param {Reading | undefined} reading
 * @param {Context["t"]} t
 */
function lossOf(reading, t) {
  return (reading && noteOf({ state: reading.state, age: reading.age, alarm: "" }, t)) || t("not known");
}

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
 * Describe the attitude in words that do not depend on a convention. An attitude with an unknown angle
 * is never called level.
 *
 * @param {Lean} lean
 * @param {readonly (keyof Lean)[]} missing
 * @param {Context["t"]} t
 */
function wordsOf({ bank, nose }, missing, t) {
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
  const isPart = missing.includes("bank") || missing.includes("nose");
  return isPart || (bank === null && nose === null) ? "—" : t("level");
}
