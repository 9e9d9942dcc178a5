// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { attribute, clamp, drawing, noteOf, number, part, style, write } from "urc/kit";
import { angleOf, bearing, bearingOf, figures, point, turn } from "./bearing.js";
import { Choice } from "./choice.js";
import { PER_DEGREE, drawRose, drawStrip, needle } from "./rose.js";

/** Angle convention of each axis convention: clockwise from north, or counter-clockwise from east. */
const CONVENTIONS = { bearing: "bearing", NED: "bearing", FRD: "bearing", ENU: "yaw", FLU: "yaw" };
/** Position, at the end of the tape, of marks beyond the tape. */
const EDGE = 96;
/** Distance from the middle beyond which a label would be cut off, in degrees. */
const SEEN = 53;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t } = ctx;
    const root = part(el, ".compass");
    const text = part(el, ".compass-text");
    const pointText = part(el, ".compass-point");
    const note = part(el, ".compass-note");
    let convention = "";
    const declination = Number(options["declination"] ?? 0);
    let unit = "";
    const read = (/** @type {Reading | undefined} */ reading) => {
      const value = number(reading);
      if (value === null) return null;
      return bearing(bearingOf(value, reading?.signal.unit ?? "", convention) + declination);
    };
    const face = options["view"] === "tape" ? new Tape(el) : new Rose(el, options["up"] === "vehicle");
    const choice = el.querySelector(".compass-set")
      ? new Choice(ctx, (degrees) => angleOf(degrees - declination, unit, convention))
      : null;

    return {
      update({ heading, course, target }, { set_heading: outlet }) {
        if (!heading) return;
        unit = heading.signal.unit ?? "";
        convention = String(options["convention"] ?? CONVENTIONS[heading.signal.axes ?? "bearing"]);
        const degrees = read(heading);
        attribute(root, "data-state", heading.state);
        attribute(root, "data-alarm", heading.alarm);
        attribute(root, "data-known", degrees === null ? "no" : "yes");
        write(text, figures(degrees));
        write(pointText, degrees === null ? "" : point(degrees));
        const up = face.show(degrees, read(course), read(target));
        choice?.update(degrees, up, outlet);
        const goal = read(target);
        const way = degrees === null || goal === null ? null : turn(degrees, goal);
        write(note, [noteOf(heading, t), wayText(way, t)].filter(Boolean).join(" · "));
      },
    };
  },
};

/**
 * @param {number | null} way turn in degrees, positive to the right
 * @param {Context["t"]} t
 */
function wayText(way, t) {
  if (way === null) return "";
  const degrees = Math.abs(Math.round(way));
  if (degrees === 0) return t("on target");
  return way > 0 ? t("target {degrees}° right", { degrees }) : t("target {degrees}° left", { degrees });
}

class Rose {
  /**
   * @param {HTMLElement} el
   * @param {boolean} isVehicleUp
   */
  constructor(el, isVehicleUp) {
    this.isVehicleUp = isVehicleUp;
    this.rose = drawing(el, ".compass-rose");
    this.letters = drawRose(drawing(el, ".compass-ticks"), drawing(el, ".compass-letters"));
    this.needle = drawing(el, ".compass-needle polygon");
    this.marks = [drawing(el, ".compass-course"), drawing(el, ".compass-target")];
    this.up = 0;
  }

  /**
   * @param {number | null} heading
   * @param {(number | null)[]} others course, target
   * @returns {number} bearing at the top
   */
  show(heading, ...others) {
    if (this.isVehicleUp && heading !== null && heading !== this.up) {
      this.up = heading;
      style(this.rose, "transform", `rotate(${(-heading).toFixed(2)}deg)`);
      for (const letter of this.letters) style(letter, "transform", `rotate(${heading.toFixed(2)}deg)`);
    }
    if (heading !== null) attribute(this.needle, "points", needle(heading - this.up));
    this.marks.forEach((mark, place) => {
      const degrees = others[place] ?? null;
      attribute(mark, "visibility", degrees === null ? "hidden" : "visible");
      if (degrees !== null) style(mark, "transform", `rotate(${(degrees - this.up).toFixed(2)}deg)`);
    });
    return this.up;
  }
}

class Tape {
  /** @param {HTMLElement} el */
  constructor(el) {
    this.strip = drawing(el, ".compass-strip");
    this.labels = drawStrip(this.strip);
    this.marks = [drawing(el, ".compass-course"), drawing(el, ".compass-target")];
  }

  /**
   * @param {number | null} heading
   * @param {(number | null)[]} others course, target
   * @returns {number}
   */
  show(heading, ...others) {
    if (heading !== null) {
      style(this.strip, "transform", `translateX(${(-heading * PER_DEGREE).toFixed(2)}px)`);
      for (const { degrees, text } of this.labels) {
        attribute(text, "visibility", Math.abs(degrees - heading) > SEEN ? "hidden" : null);
      }
    }
    this.marks.forEach((mark, place) => {
      const degrees = others[place] ?? null;
      const isShown = degrees !== null && heading !== null;
      attribute(mark, "visibility", isShown ? "visible" : "hidden");
      if (!isShown) return;
      const x = clamp(turn(heading, degrees) * PER_DEGREE, -EDGE, EDGE);
      style(mark, "transform", `translateX(${x.toFixed(2)}px)`);
    });
    return heading ?? 0;
  }
}
