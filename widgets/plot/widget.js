// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./live.js").Trace} Trace */
import { ALARMS, DASH, attribute, clock, colours, figure, isStill, many, noteOf, number, part, save, style, write } from "urc/kit";
import { spanOf } from "urc/axis_ticks";
import { History } from "./history.js";
import { Live } from "./live.js";
import { epoch, legendItem, ruled, sharedWords, writeValue } from "./parts.js";
import { SmallLegend } from "./small_legend.js";
import { Ring, csv, extent, seconds, spanFor, table } from "./traces.js";

const COLOURS = /** @type {const} */ (["series-1", "series-2", "series-3", "series-4", "series-5", "series-6"]);
/** Dash patterns for lines without a colour of their own, and for all lines in a theme with one colour. */
const DASHES = [[], [8, 4], [2, 3], [10, 3, 2, 3]];
const HERTZ = 60;
const MOST_READINGS = 18_000;
/** Update interval of the legend: faster numbers are unreadable, and text is the slowest part of a frame. */
const LEGEND_EVERY_MS = 250;
const FIT_EVERY_MS = 1000;
/** Used fraction of the scale below which the scale shrinks. */
const LOOSE = 0.4;
/** Margin above and below, as a fraction of the height. */
const RIM = 0.05;

/** @param {number} count @param {Context} ctx */
function moreReadings(count, ctx) {
  return count === 1 ? ctx.t("1 more reading") : ctx.t("{count} more readings", { count });
}

class Plot {
  /** @param {Context} ctx */
  constructor(ctx) {
    this.ctx = ctx;
    const { el, options } = ctx;
    this.root = part(el, ".plot");
    this.board = part(el, ".plot-board");
    this.note = part(el, ".plot-note");
    this.legend = new SmallLegend(this.root, part(el, ".plot-legend"), (count) => moreReadings(count, ctx), ctx.signal);
    this.pauseButton = part(el, ".plot-pause");
    this.place = part(el, ".plot-history");
    this.windowS = seconds(options["window"]);
    this.live = new Live(part(el, ".plot-picture"), spanFor(0, this.windowS));
    this.spanText = part(el, ".plot-span");
    /** @type {readonly Reading[]} */
    this.readings = [];
    /** @type {number[]} */
    this.serials = [];
    /** Conversion to the displayed unit; stored values are unconverted. @type {(value: number) => number} */
    this.factor = (value) => value;
    /** Signals of the present legend and scale. @type {Reading["signal"][]} */
    this.signals = [];
    this.symbol = "";
    /** Whether all signals have the same unit; otherwise, values keep their declared units. */
    this.isOneUnit = true;
    this.legendMs = 0;
    /** Whether the legend is up to date. */
    this.isTold = true;
    this.fitMs = 0;
    /** @type {History | null} */
    this.history = null;
    this.pausing = 0;
    this.isSeen = true;
    this.timer = 0;
    this.tellSpan();
    this.listen();
  }

  listen() {
    const { ctx } = this;
    const { signal } = ctx;
    const click = (/** @type {string} */ selector, /** @type {() => void} */ what) =>
      part(ctx.el, selector).addEventListener("click", what, { signal });
    click(".plot-pause", () => void this.toggle());
    click(".plot-closer", () => this.history?.zoom(0.5));
    click(".plot-wider", () => this.history?.zoom(2));
    click(".plot-save", () => this.save());
    this.place.addEventListener("keydown", (event) => this.key(event), { signal });
    ctx.follow("theme", () => this.paint());
    const sizes = new ResizeObserver(([entry]) => {
      if (entry) this.live.resize(entry.contentRect);
      this.soon();
    });
    sizes.observe(this.board);
    const sight = new IntersectionObserver((entries) => {
      this.isSeen = entries.at(-1)?.isIntersecting ?? true;
      this.live.spoil();
      this.soon();
    });
    sight.observe(this.board);
    // The time advances even without readings. With reduced motion, it advances once a second.
    const step = () => {
      if (this.isSeen) this.frame(performance.now());
      else if (!this.isTold) this.tell(); // screen readers need the legend while the plot is hidden
      this.timer = isStill() ? window.setTimeout(step, 1000) : requestAnimationFrame(step);
    };
    step();
    signal.addEventListener("abort", () => {
      cancelAnimationFrame(this.timer);
      clearTimeout(this.timer);
      sizes.disconnect();
      sight.disconnect();
      this.history?.close();
    });
  }

  /** @param {readonly Reading[]} readings */
  update(readings) {
    this.readings = readings;
    const { symbol, factor } = this.ctx.unit("series");
    const isOther = readings.length !== this.signals.length || readings.some(({ signal }, place) => signal !== this.signals[place]);
    if (isOther) this.begin();
    if (isOther || symbol !== this.symbol) this.showIn(symbol, factor);
    readings.forEach((reading, place) => {
      const ring = this.live.traces[place]?.ring;
      if (!ring) return;
      const value = number(reading);
      if (reading.state !== "live" || value === null) ring.cut();
      else if (reading.serial !== this.serials[place]) {
        ring.add(reading.time, value, reading.signal.stale_after_s ?? 0);
        this.include(value);
      }
      this.serials[place] = reading.serial;
    });
    this.isTold = false;
  }

  /** Create a line for each signal. Earlier readings stay. */
  begin() {
    const traces = new Map(this.signals.map(({ name, unit }, place) => [`${name} ${unit}`, this.live.traces[place]]));
    this.signals = this.readings.map(({ signal }) => signal);
    this.isOneUnit = new Set(this.signals.map(({ unit }) => unit)).size === 1;
    const size = Math.min(MOST_READINGS, Math.max(600, this.windowS * HERTZ));
    this.live.traces = this.signals.map(({ name, unit }, place) => ({
      ring: traces.get(`${name} ${unit}`)?.ring ?? new Ring(size),
      colour: "",
      dash: [...(DASHES[Math.floor(place / COLOURS.length) % DASHES.length] ?? [])],
      isShown: traces.get(`${name} ${unit}`)?.isShown ?? true,
      kept: 0,
      keptWay: 0,
      drawn: 0,
      drawnWay: 0,
    }));
    this.list();
    this.paint();
    this.fit(true);
  }

  /**
   * Change the displayed unit. The lines stay; only their labels change.
   *
   * @param {string} symbol
   * @param {(value: number) => number} factor
   */
  showIn(symbol, factor) {
    this.symbol = symbol;
    this.factor = this.isOneUnit ? factor : (value) => value;
    this.rule();
    if (!this.history) return;
    this.history.convert();
    this.read(this.history.values);
  }

  /** Rebuild the legend: one button for each signal, which hides its line. */
  list() {
    const { signal: end, t } = this.ctx;
    const names = this.readings.map(({ signal }) => signal.title || signal.name);
    const shared = sharedWords(names);
    const items = names.map((name, place) => {
      const { item, button } = legendItem(name, shared, t("Show or hide {name}", { name }), this.live.traces[place]?.isShown ?? true);
      button.addEventListener("click", () => this.show(place, button), { signal: end });
      return item;
    });
    this.legend.fill(items);
  }

  /**
   * @param {number} place
   * @param {HTMLElement} button
   */
  show(place, button) {
    const trace = this.live.traces[place];
    if (!trace) return;
    trace.isShown = !trace.isShown;
    attribute(button, "aria-pressed", String(trace.isShown));
    this.history?.show(place, trace.isShown);
    this.fit(true);
    this.live.spoil(); // even with an unchanged scale
    this.soon();
  }

  /** Read the colours of the theme. */
  paint() {
    const palette = colours(this.root, COLOURS);
    const swatches = this.legend.list.querySelectorAll(".plot-swatch");
    this.live.traces.forEach((trace, place) => {
      trace.colour = palette[COLOURS[place % COLOURS.length] ?? "series-1"];
      const swatch = swatches[place];
      if (!swatch) return;
      style(swatch, "--plot-colour", trace.colour);
      attribute(swatch, "data-dash", String(Math.floor(place / COLOURS.length) % DASHES.length));
    });
    this.live.spoil();
    this.soon();
  }

  /** Draw immediately, even if the picture moves only once a second. */
  soon() {
    if (isStill()) requestAnimationFrame(() => this.frame(performance.now()));
  }

  /**
   * Extend the scale immediately for a value beyond its end.
   *
   * @param {number} value
   */
  include(value) {
    const [least, most] = this.live.scale;
    if (value < least || value > most) this.fit(true);
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    if (this.ctx.signal.aborted || this.history) return;
    if (nowMs - this.fitMs > FIT_EVERY_MS) this.fit(false);
    if (!this.isTold && nowMs - this.legendMs > LEGEND_EVERY_MS) this.tell();
    this.live.frame(nowMs / 1000);
  }

  /** @param {boolean} isNeeded false: only change the scale if much of it is empty */
  fit(isNeeded) {
    const nowMs = performance.now();
    this.fitMs = nowMs;
    this.widen(nowMs / 1000);
    const shown = this.live.traces.filter((trace) => trace.isShown).map(({ ring }) => ring);
    const [least, most] = extent(shown, nowMs / 1000 - this.windowS);
    const [bottom, top] = spanOf(least, most, this.limits().map(([, limit]) => limit));
    const rim = (top - bottom) * RIM;
    const { min, max } = this.ctx.options;
    const wanted = [typeof min === "number" ? min : bottom - rim, typeof max === "number" ? max : top + rim];
    const [start = 0, end = 1] = wanted;
    const [was, till] = this.live.scale;
    const isLoose = end - start < (till - was) * LOOSE;
    if ((!isNeeded && !isLoose) || !(end > start) || (start === was && end === till)) return;
    this.live.scale = [start, end];
    this.live.spoil();
    this.rule();
  }

  /** Let the time span grow with the readings: a new plot is not mostly empty. @param {number} nowS */
  widen(nowS) {
    const rings = this.live.traces.map(({ ring }) => ring).filter(({ count }) => count > 0);
    const oldestS = Math.min(nowS, ...rings.map((ring) => ring.time(ring.first)));
    const span = spanFor(nowS - oldestS, this.windowS);
    if (span === this.live.spanS) return;
    this.live.spanS = span;
    this.live.spoil();
    this.tellSpan();
  }

  tellSpan() {
    const { spanS } = this.live;
    const time = spanS % 60 === 0 && spanS > 60 ? `${spanS / 60} min` : `${spanS} s`;
    write(this.spanText, this.ctx.t("last {time}", { time }));
  }

  /** @returns {[string, number][]} */
  limits() {
    if (this.ctx.options["limits"] === false) return [];
    const all = this.readings.flatMap(({ signal }) => Object.entries(signal.limits ?? {}));
    return all.filter(([name]) => Object.hasOwn(ALARMS, name));
  }

  /** Write the labels of the scale, and the lines of the limits. */
  rule() {
    const { figures, lines } = ruled(this.live.scale, this.limits(), this.factor);
    part(this.ctx.el, ".plot-scale").replaceChildren(...figures);
    part(this.ctx.el, ".plot-lines").replaceChildren(...lines);
  }

  /** Write the values of the legend, and the note. */
  tell() {
    this.isTold = true;
    this.legendMs = performance.now();
    const order = /** @type {const} */ (["gone", "stale", "none", "live"]);
    const worst = order.map((state) => this.readings.find((reading) => reading.state === state)).find(Boolean);
    const alarm = ["hihi", "lolo", "high", "low"].find((name) => this.readings.some((each) => each.alarm === name));
    const isAllOld = this.readings.every(({ state }) => state !== "live");
    attribute(this.root, "data-state", isAllOld ? (worst?.state ?? "none") : "live");
    attribute(this.root, "data-alarm", alarm ?? "");
    if (this.history) return;
    const { t } = this.ctx;
    if (worst && worst.state !== "live") {
      const said = noteOf(worst, t);
      const name = worst.signal.title || worst.signal.name;
      write(this.note, this.readings.length > 1 ? `${name}: ${said}` : said);
    } else write(this.note, "");
    const units = this.legend.list.querySelectorAll(".plot-value");
    let isWider = false;
    this.readings.forEach((reading, place) => {
      const value = units[place];
      if (!value) return;
      isWider = writeValue(value, reading.value === null ? reading.text : `${reading.text} ${reading.unit}`.trim()) || isWider;
      attribute(value, "data-state", reading.state);
    });
    if (isWider) this.legend.fit();
  }

  async toggle() {
    this.pausing += 1;
    const mine = this.pausing;
    const { t } = this.ctx;
    if (this.history || this.root.hasAttribute("data-paused")) {
      this.history?.close();
      this.history = null;
      this.face(false);
      this.live.spoil();
      this.tell();
      return;
    }
    this.face(true);
    const rows = this.rows([-Infinity, Infinity]);
    const lines = this.readings.map(({ signal }, place) => ({
      title: signal.title || signal.name,
      unit: signal.unit ?? "",
      colour: this.live.traces[place]?.colour ?? "",
      dash: this.live.traces[place]?.dash ?? [],
      isShown: this.live.traces[place]?.isShown ?? true,
    }));
    const { muted, faint } = colours(this.root, ["muted", "faint"]);
    const moved = (/** @type {number | null} */ at) => this.moved(at);
    const factor = (/** @type {number} */ value) => this.factor(value);
    const look = { colour: muted, grid: faint, epoch: epoch(), moved, factor };
    try {
      await this.ctx.style("uplot");
      const opened = await History.open(this.place, lines, rows, look);
      if (mine === this.pausing && !this.ctx.signal.aborted) this.history = opened;
      else opened.close();
    } catch (error) {
      console.info("plot: no history:", error);
      this.face(false);
      write(this.note, t("this installation does not store history"));
    }
  }

  /** @param {boolean} isPaused */
  face(isPaused) {
    const { el, t } = this.ctx;
    this.root.toggleAttribute("data-paused", isPaused);
    write(this.pauseButton, isPaused ? t("Resume") : t("Pause"));
    attribute(this.pauseButton, "aria-pressed", String(isPaused));
    for (const name of ["closer", "wider", "save"]) part(el, `.plot-${name}`).hidden = !isPaused;
    this.place.hidden = !isPaused;
    this.board.hidden = isPaused;
    write(this.note, isPaused ? t("paused") : "");
  }

  /**
   * Write the values at a new position of the cursor.
   *
   * @param {number | null} time in seconds
   */
  moved(time) {
    const values = time === null ? null : this.history?.values;
    if (time === null || !values) return;
    write(this.note, clock(new Date(epoch() + time * 1000)));
    this.read(values);
  }

  /** @param {readonly (number | null)[]} values values of the legend */
  read(values) {
    const places = this.legend.list.querySelectorAll(".plot-value");
    this.signals.forEach(({ precision, unit = "" }, place) => {
      const value = values[place] ?? null;
      const symbol = this.isOneUnit ? this.symbol : unit;
      const text = value === null ? DASH : `${figure(value, precision, this.factor)} ${symbol}`.trim();
      const el = places[place];
      if (el) writeValue(el, text);
    });
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const { history } = this;
    if (!history) return;
    const step = event.shiftKey ? 10 : 1;
    /** @type {Record<string, () => void>} */
    const does = {
      ArrowLeft: () => history.move(-step),
      ArrowRight: () => history.move(step),
      "+": () => history.zoom(0.5),
      "-": () => history.zoom(2),
    };
    const what = does[event.key];
    if (!what) return;
    event.preventDefault();
    what();
  }

  /** @param {[number, number]} span in seconds */
  rows([from, to]) {
    return table(this.live.traces.map(({ ring }) => ring), from, to);
  }

  /** Save the visible range to a file, in the robot's units. */
  save() {
    const names = this.signals.map(({ name, unit }) => (unit ? `${name} (${unit})` : name));
    save(csv(names, this.rows(this.history?.span ?? [-Infinity, Infinity]), epoch()), "plot.csv", "text/csv");
  }
}

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const plot = new Plot(ctx);
    return {
      update({ series }) {
        if (series) plot.update(Array.isArray(series) ? many(series) : [series]);
      },
    };
  },
};
