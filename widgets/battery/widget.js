// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {Readonly<Record<string, Reading>>} Readings */
import { attribute, drawing, fit, format, many, noteOf, number, numbers, part, style, tell, worst, write } from "urc/kit";
import { share } from "urc/axis_ticks";
import { Mean, cellScale, clock, spread, timeLeft } from "./charge.js";
import { INSIDE, mark } from "./drawing.js";

/** Width of a character of the unit, relative to a digit. */
const UNIT_WIDTH = 0.86;
const MEAN_S = 30;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, t } = ctx;
    const root = part(el, ".battery");
    const note = part(el, ".battery-note");
    const shell = el.querySelector(".battery-meter") ? new Shell(ctx) : null;
    const cells = el.querySelector(".battery-cells") ? new Cells(ctx) : null;
    const large = el.querySelector(".battery-large");
    const current = new Mean(MEAN_S);

    return {
      update(readings) {
        const { level, status } = readings;
        if (level) shell?.update(level);
        else if (large && readings["voltage"]) figure(el, readings["voltage"]);
        const imbalance = cells?.update(readings) ?? "";
        for (const name of ["voltage", "current", "temperature"]) {
          const place = el.querySelector(`.battery-${name}`);
          const reading = readings[name];
          if (place && reading) fact(place, reading);
        }
        const left = el.querySelector(".battery-time");
        if (left) {
          const flow = current.add(number(readings["current"]), readings["current"]?.time ?? 0);
          const given = number(readings["time_left"]);
          const rest = readings["time_left"] ? given : timeLeft(number(level), flow, options["capacity"]);
          write(left, t("{time} left", { time: timeText(rest, ctx) }));
        }

        const lead = level ?? worst([readings["cells"], ...many(readings["modules"]), readings["voltage"]]);
        attribute(root, "data-state", lead.state);
        attribute(root, "data-alarm", lead.alarm || (imbalance ? "low" : ""));
        const said = [noteOf(lead, t), imbalance, status?.value ? status.text : ""];
        write(note, said.filter(Boolean).join(" · "));
      },
    };
  },
};

/** The drawing of the battery with its level. */
class Shell {
  /** @param {Context} ctx */
  constructor({ el, t }) {
    this.el = el;
    this.t = t;
    this.meter = part(el, ".battery-meter");
    this.full = part(el, ".battery-level");
    this.pictures = Object.entries(INSIDE).map(([name, inside]) => ({
      inside,
      isLying: name === "lying",
      limits: drawing(el, `.battery-${name} .battery-limits`),
    }));
    /** Signal of the drawn limits. @type {Reading["signal"] | null} */
    this.drawn = null;
  }

  /** @param {Reading} level */
  update(level) {
    const { signal } = level;
    const [least, most] = [signal.min ?? 0, signal.max ?? 100];
    const known = number(level);
    const full = known === null ? 0 : share(known, least, most);
    const symbol = known === null ? "" : (signal.unit ?? "%");
    const text = known === null ? "—" : level.text;
    figure(this.el, level, signal.unit ?? "%");
    style(this.full, "--battery-full", full.toFixed(3));
    if (signal !== this.drawn) this.draw(signal, least, most);
    const said = noteOf(level, this.t).replace(/^[▲◆◇] /u, "");
    tell(this.meter, {
      "aria-valuemin": String(least),
      "aria-valuemax": String(most),
      "aria-valuenow": String(known ?? least),
      "aria-valuetext": known === null ? this.t("unknown") : `${text} ${symbol}${said ? `, ${said}` : ""}`,
    });
  }

  /**
   * Mark the limits.
   *
   * @param {Reading["signal"]} signal
   * @param {number} least
   * @param {number} most
   */
  draw(signal, least, most) {
    this.drawn = signal;
    const marks = Object.values(signal.limits ?? {})
      .filter((limit) => typeof limit === "number")
      .map((limit) => (limit - least) / (most - least))
      .filter((place) => place > 0 && place < 1);
    for (const { inside, isLying, limits } of this.pictures) {
      attribute(limits, "d", marks.map((place) => mark(inside, place, isLying)).join(""));
    }
  }
}

/** One bar for each cell or module; the lowest and the highest are marked. */
class Cells {
  /** @param {Context} ctx */
  constructor({ el, options, t }) {
    this.options = options;
    this.t = t;
    this.list = part(el, ".battery-cells");
    /** The lowest cell, for a cell of the page that is too low for all figures. */
    this.least = el.querySelector(".battery-least");
    /** @type {HTMLElement[]} */
    this.items = [];
  }

  /**
   * @param {Readings} readings
   * @returns {string} the problem, or ""
   */
  update({ cells, modules }) {
    const each = many(modules);
    const values = [...(numbers(cells) ?? []), ...each.map(number)];
    const signal = cells?.signal ?? each[0]?.signal;
    if (!signal) return "";
    this.grow(values.length);
    const [least, most] = cellScale(signal, this.options);
    const known = values.filter((value) => value !== null);
    const [lowest, highest] = [Math.min(...known), Math.max(...known)];
    const unit = signal.unit ?? "";
    const digits = signal.precision ?? (unit === "V" ? 2 : undefined);
    if (this.least) write(this.least, known.length > 0 ? `▾ ${format(lowest, digits)} ${unit}`.trim() : "—");
    const old = [...(cells ? Array(values.length - each.length).fill(cells.state) : []), ...each.map(({ state }) => state)];
    values.forEach((value, place) => {
      const item = this.items[place];
      if (!item) return;
      write(part(item, ".battery-figure"), format(value, digits));
      style(item, "--battery-share", value === null ? "0" : share(value, least, most).toFixed(3));
      const end = value === lowest ? "low" : value === highest ? "high" : "";
      attribute(item, "data-end", known.length > 1 && lowest !== highest ? end : "");
      attribute(item, "data-state", value === null ? "none" : (old[place] ?? "live"));
    });
    const apart = spread(values);
    const most_apart = this.options["imbalance"];
    if (apart === null || typeof most_apart !== "number" || apart <= most_apart) return "";
    return this.t("◆ Cells differ by {value}", { value: `${format(apart, signal.precision)} ${unit}`.trim() });
  }

  /** @param {number} count */
  grow(count) {
    if (this.items.length === count && count > 0) return;
    this.items = Array.from({ length: count }, (_, place) => {
      const item = document.createElement("li");
      item.className = "battery-cell";
      for (const name of ["place", "bar", "figure"]) {
        const made = document.createElement("span");
        made.className = `battery-${name}`;
        made.textContent = name === "place" ? String(place + 1) : "";
        item.append(made);
      }
      return item;
    });
    if (count > 0) this.list.replaceChildren(...this.items);
  }
}

/**
 * Write the large number, if the widget has one.
 *
 * @param {HTMLElement} el
 * @param {Reading} reading
 * @param {string} [unit]
 */
function figure(el, reading, unit = reading.unit) {
  const box = el.querySelector(".battery-number");
  if (!box) return;
  const isKnown = number(reading) !== null;
  const [text, symbol] = isKnown ? [reading.text, unit] : ["—", ""];
  fit(box, "--battery-characters", text.length + UNIT_WIDTH * symbol.length, true);
  write(part(box, ".battery-digits"), text);
  write(part(box, ".battery-unit"), symbol);
}

/**
 * @param {Element} place
 * @param {Reading} reading
 */
function fact(place, reading) {
  const isKnown = number(reading) !== null;
  write(place, isKnown ? `${reading.text} ${reading.unit}`.trim() : "—");
  attribute(place, "data-state", reading.state);
  attribute(place, "data-alarm", reading.alarm);
}

/**
 * @param {number | null} seconds
 * @param {Context} ctx
 */
function timeText(seconds, { t }) {
  if (seconds === null) return "—";
  const { hours, minutes } = clock(seconds);
  if (hours > 0) return t("{hours} h {minutes} min", { hours, minutes: String(minutes).padStart(2, "0") });
  return minutes > 0 ? t("{minutes} min", { minutes }) : t("under 1 min");
}
