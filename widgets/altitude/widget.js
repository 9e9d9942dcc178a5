// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
import { HeightTape } from "urc/height_tape";
import { attribute, clamp, drawing, format, noteOf, number, part, style, write } from "urc/kit";

/** Climb below which the flight counts as level, as a fraction of a unit. */
const LEVEL = 0.05;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t } = ctx;
    const root = part(el, ".altitude");
    const text = part(el, ".altitude-text");
    const unit = part(el, ".altitude-unit");
    const note = part(el, ".altitude-note");
    const strip = el.querySelector(".altitude-tape") ? tapeOf(el, options) : null;
    const digits = Number(options["precision"] ?? 1);

    return {
      update({ altitude, relative, climb }) {
        if (!altitude) return;
        const { symbol, factor } = ctx.unit("altitude");
        const value = number(altitude);
        const shown = value === null ? null : factor(value);
        const figure = format(shown, digits);
        attribute(root, "data-state", altitude.state);
        attribute(root, "data-alarm", altitude.alarm);
        attribute(root, "data-known", value === null ? "no" : "yes");
        style(root, "--altitude-characters", String(clamp(2 * Math.ceil((figure.length + symbol.length / 2) / 2), 4, 20)));
        if (shown !== null) strip?.show(shown);
        write(text, figure);
        write(unit, value === null ? "" : symbol);
        write(note, noteOf(altitude, t));

        const height = fact(el, "relative", relative);
        if (height) {
          const known = number(relative);
          const own = ctx.unit("relative");
          const said = known === null ? "—" : `${format(own.factor(known), digits)} ${own.symbol}`.trim();
          write(height, t("{value} above start", { value: said }));
        }
        const rate = fact(el, "climb", climb);
        if (rate) {
          const known = number(climb);
          const own = ctx.unit("climb");
          write(rate, known === null ? "—" : climbText(own.factor(known), own.symbol, t));
        }
      },
    };
  },
};

/**
 * @param {HTMLElement} el
 * @param {Readonly<Record<string, unknown>>} options
 */
function tapeOf(el, options) {
  const look = { rung: "altitude-rung", label: "altitude-label", right: 74 };
  return new HeightTape(drawing(el, ".altitude-tape"), Number(options["span"] ?? 20), look);
}

/**
 * @param {HTMLElement} el
 * @param {string} name
 * @param {Reading | undefined} reading
 */
function fact(el, name, reading) {
  const place = el.querySelector(`.altitude-${name}`);
  if (place && reading) attribute(place, "data-state", reading.state);
  return reading ? place : null;
}

/**
 * @param {number} rate
 * @param {string} symbol
 * @param {Context["t"]} t
 */
function climbText(rate, symbol, t) {
  const value = `${format(Math.abs(rate), 1)} ${symbol}`.trim();
  if (Math.abs(rate) < LEVEL) return t("→ level");
  return rate > 0 ? t("↑ climbs {value}", { value }) : t("↓ sinks {value}", { value });
}
