// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { attribute, digitsIn, figure, fit, format, noteOf, number, part as find, write } from "urc/kit";
import { spanOf } from "urc/axis_ticks";
import { Trend } from "./trend.js";

const LIMITS = /** @type {const} */ (["lolo", "low", "high", "hihi"]);
const POINTS = 600;
const DRAW_EVERY_MS = 100;
const MOVE_EVERY_MS = 1000;
/** Time span of the trend, in seconds. */
const TREND_S = 10;
/** Margin above and below, as a fraction of the height. */
const RIM = 0.04;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el, options, signal, t } = ctx;
    const root = find(el, ".value");
    const line = find(el, ".value-figure");
    const text = find(el, ".value-text");
    const unit = find(el, ".value-unit");
    const note = find(el, ".value-note");
    const place = el.querySelector(".value-history");
    const windowS = seconds(options["history"]);
    const history = place && windowS ? new History(place, windowS) : null;
    const facts = new Facts(ctx);
    signal.addEventListener("abort", () => history?.destroy());
    /** Last drawn state of all parts except the number. */
    let seen = "";

    return {
      update({ value: reading }) {
        if (!reading) return;
        const { symbol: known, factor } = ctx.unit("value");
        const shown = textOf(reading, options["precision"], factor, t);
        const symbol = reading.value === null ? "" : reading.unit || known;
        fit(line, "--value-characters", shown.length + symbol.length / 2);
        write(text, shown);
        // The state rarely changes, and comparing each part takes longer than writing the number.
        const look = `${reading.state} ${reading.alarm} ${reading.age} ${symbol}`;
        if (look !== seen) {
          seen = look;
          attribute(root, "data-state", reading.state);
          attribute(root, "data-alarm", reading.alarm);
          write(unit, symbol);
          write(note, noteOf(reading, t));
        }
        facts.update(reading, symbol, factor);
        history?.add(reading, factor);
      },
    };
  },
};

/** Optional facts about the value: trend, limits and age. */
class Facts {
  /** @param {Context} ctx */
  constructor({ el, options, signal, t }) {
    this.t = t;
    this.precision = options["precision"];
    this.trendText = el.querySelector(".value-trend");
    this.limitsText = el.querySelector(".value-limits");
    this.ageText = el.querySelector(".value-age");
    this.trend = new Trend(TREND_S);
    this.serial = -1;
    this.time = NaN;
    if (!this.ageText) return;
    const timer = setInterval(() => this.tell(), MOVE_EVERY_MS);
    signal.addEventListener("abort", () => clearInterval(timer));
  }

  /**
   * @param {Reading} reading
   * @param {string} symbol
   * @param {(value: number) => number} factor
   */
  update(reading, symbol, factor) {
    const value = number(reading);
    if (this.trendText) this.point(reading, value);
    if (this.limitsText) {
      const { lolo, low, high, hihi } = reading.signal.limits ?? {};
      const digits = digitsIn(typeof this.precision === "number" ? this.precision : reading.signal.precision, factor);
      const ends = [low ?? lolo, high ?? hihi].map((end) => (end === undefined ? "" : format(factor(end), digits)));
      const said = ends.some(Boolean) ? `${ends.join(" … ").trim()} ${symbol}`.trim() : "";
      write(this.limitsText, said ? this.t("limits {range}", { range: said }) : "");
    }
    this.time = reading.state === "none" ? NaN : reading.time;
    this.tell();
  }

  /**
   * @param {Reading} reading
   * @param {number | null} value
   */
  point(reading, value) {
    if (reading.state !== "live" || value === null) this.trend.clear();
    else if (reading.serial !== this.serial) {
      this.serial = reading.serial;
      this.trend.add(reading.time, value);
    }
    const least = reading.signal.precision === undefined ? 0 : 10 ** -reading.signal.precision;
    const direction = this.trend.direction(least);
    const words = { up: this.t("↗ rising"), down: this.t("↘ falling"), flat: this.t("→ steady") };
    const said = direction === null ? "" : words[direction > 0 ? "up" : direction < 0 ? "down" : "flat"];
    if (this.trendText) write(this.trendText, said);
  }

  tell() {
    if (!this.ageText) return;
    const old = Math.max(0, performance.now() / 1000 - this.time);
    write(this.ageText, Number.isFinite(old) ? this.t("{seconds} s ago", { seconds: Math.floor(old) }) : "");
  }
}

/** The last minutes as a line, drawn by uPlot if uPlot is installed. */
class History {
  /**
   * @param {Element} root contains the three parts
   * @param {number} windowS
   */
  constructor(root, windowS) {
    this.root = root;
    this.windowS = windowS;
    this.place = find(root, ".value-plot");
    this.most = find(root, ".value-most");
    this.least = find(root, ".value-least");
    /** @type {number[]} */
    this.times = [];
    /**
     * Values in the signal's unit, because the displayed unit may change. A gap is null and is not drawn.
     * @type {(number | null)[]}
     */
    this.values = [];
    /** Lowest and highest drawn value. @type {[number, number]} */
    this.scale = [0, 1];
    /** @type {Reading["signal"]} */
    this.signal = { name: "", type: "number" };
    /** Conversion to the displayed unit. */
    this.factor = (/** @type {number} */ value) => value;
    this.serial = -1;
    this.drawnMs = 0;
    this.limitsShown = "";
    /** uPlot's instance; its types are not part of this page. @type {any} */
    this.plot = null;
    this.isOver = false;
    // The line advances with time, even without readings.
    this.timer = setInterval(() => this.draw(), MOVE_EVERY_MS);
    // Not the cell's size: the numbers next to the line use some of its width.
    this.sizes = new ResizeObserver(() => this.plot?.setSize(sizeOf(this.place)));
    void this.load();
  }

  async load() {
    try {
      const name = "uplot";
      const { default: Plot } = await import(name);
      if (this.isOver) return;
      const end = () => performance.now() / 1000;
      const options = {
        ...sizeOf(this.place),
        padding: [0, 0, 0, 0],
        cursor: { show: false },
        legend: { show: false },
        axes: [{ show: false }, { show: false }],
        scales: {
          x: { time: false, range: () => [end() - this.windowS, end()] },
          y: { range: () => this.scale },
        },
        // Read again for each drawing, so that the line follows the theme.
        series: [{}, { stroke: () => getComputedStyle(this.place).color, width: 2, points: { show: false } }],
      };
      this.plot = new Plot(options, [this.times, this.values], this.place);
      this.sizes.observe(this.place);
    } catch (error) {
      // The number works without the line; some installations lack uPlot.
      console.info("value: no history is drawn:", error);
      if (this.root instanceof HTMLElement) this.root.hidden = true;
    }
  }

  /**
   * @param {Reading} reading
   * @param {(value: number) => number} factor conversion to the displayed unit
   */
  add(reading, factor) {
    const { state, signal, serial, time } = reading;
    const value = number(reading);
    const isOther = factor !== this.factor;
    this.signal = signal;
    this.factor = factor;
    const last = this.times.at(-1) ?? -Infinity;
    if (state !== "live" || value === null) {
      if ((this.values.at(-1) ?? null) !== null) this.push(last + 1e-3, null);
      this.draw();
    } else if (serial !== this.serial) {
      this.serial = serial;
      // At most POINTS in the window: newer readings in between replace the last point.
      const isClose = time - last < this.windowS / POINTS && typeof this.values.at(-1) === "number";
      if (isClose || time <= last) this.values[this.values.length - 1] = value;
      else this.push(time, value);
      if (isOther || performance.now() - this.drawnMs > DRAW_EVERY_MS) this.draw();
    } else if (isOther) {
      this.draw();
    }
  }

  /**
   * @param {number} time in seconds
   * @param {number | null} value
   */
  push(time, value) {
    this.times.push(time);
    this.values.push(value);
    if (this.times.length > 2 * POINTS) this.drop();
  }

  drop() {
    this.times.shift();
    this.values.shift();
  }

  draw() {
    this.drawnMs = performance.now();
    const startS = this.drawnMs / 1000 - this.windowS;
    // The last point before the window stays, because the line starts there. A gap needs no start.
    while ((this.times[1] ?? Infinity) < startS) this.drop();
    if (this.times.length === 1 && (this.times[0] ?? 0) < startS) this.drop();
    const known = this.values.filter((value) => value !== null);
    const limits = LIMITS.flatMap((name) => {
      const limit = this.signal.limits?.[name];
      return limit === undefined ? [] : [/** @type {[string, number]} */ ([name, limit])];
    });
    const ends = spanOf(Math.min(...known), Math.max(...known), limits.map(([, limit]) => limit));
    const rim = (ends[1] - ends[0]) * RIM;
    this.scale = [ends[0] - rim, ends[1] + rim];
    write(this.least, known.length > 0 ? this.figure(ends[0]) : "");
    write(this.most, known.length > 0 ? this.figure(ends[1]) : "");
    this.drawLimits(known.length > 0 ? limits : []);
    this.plot?.setData([this.times, this.values]);
  }

  /** @param {number} value */
  figure(value) {
    return format(this.factor(value), digitsIn(this.signal.precision, this.factor));
  }

  /** @param {[string, number][]} limits */
  drawLimits(limits) {
    const [least, most] = this.scale;
    const seen = limits.filter(([, limit]) => limit > least && limit < most);
    const places = seen.map(([name, limit]) => [name, `${(100 * (most - limit)) / (most - least)}%`]);
    if (JSON.stringify(places) === this.limitsShown) return;
    this.limitsShown = JSON.stringify(places);
    for (const old of this.place.querySelectorAll(".value-limit")) old.remove();
    for (const [name, top] of places) {
      const line = document.createElement("div");
      line.className = "value-limit";
      line.dataset["limit"] = name ?? "";
      line.style.top = top ?? "";
      this.place.append(line);
    }
  }

  destroy() {
    this.isOver = true;
    clearInterval(this.timer);
    this.sizes.disconnect();
    this.plot?.destroy();
  }
}

/** @param {Element} place */
function sizeOf(place) {
  return { width: Math.max(1, place.clientWidth), height: Math.max(1, place.clientHeight) };
}

/**
 * @param {unknown} text such as "60s" or "5min"
 * @returns {number} seconds; 0 if there is none
 */
function seconds(text) {
  const match = /^(\d+)(s|min)$/.exec(String(text ?? ""));
  return match ? Number(match[1]) * (match[2] === "min" ? 60 : 1) : 0;
}

/**
 * @param {Reading} reading
 * @param {unknown} precision
 * @param {(value: number) => number} factor
 * @param {Context["t"]} t
 */
function textOf(reading, precision, factor, t) {
  const { value } = reading;
  if (typeof precision === "number" && typeof value === "number") return figure(value, precision, factor);
  if (typeof value === "boolean" && reading.text === String(value)) return value ? t("yes") : t("no");
  return reading.text;
}
