// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */

const ALARMS = {
  "": "",
  lolo: "▲ Very low",
  low: "◆ Low",
  high: "◆ High",
  hihi: "▲ Very high",
};
const POINTS = 600;
const DRAW_EVERY_MS = 100;
const MOVE_EVERY_MS = 1000;
/** A limit further away than so many times the height of the line is not drawn. */
const NEAR = 3;
/** Room above and below, as a share of the height. */
const RIM = 0.04;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, signal }) {
    const root = find(el, ".value");
    const line = find(el, ".value-line");
    const text = find(el, ".value-text");
    const unit = find(el, ".value-unit");
    const note = find(el, ".value-note");
    const place = el.querySelector(".value-history");
    const windowS = seconds(options["history"]);
    const history = place && windowS ? new History(place, windowS) : null;
    signal.addEventListener("abort", () => history?.destroy());

    return {
      update({ value: reading }) {
        if (!reading) return;
        const shown = textOf(reading, options["precision"]);
        const symbol = reading.value === null ? "" : (reading.signal.unit ?? "");
        attribute(root, "data-state", reading.state);
        attribute(root, "data-alarm", reading.alarm);
        fitText(line, shown.length + symbol.length / 2);
        write(text, shown);
        write(unit, symbol);
        write(note, noteOf(reading));
        history?.add(reading);
      },
    };
  },
};

/** The last minutes as a line, drawn by uPlot where the build has brought it. */
class History {
  /**
   * @param {Element} root holds the three parts
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
    /** A gap is a null: what was not measured is not drawn. @type {(number | null)[]} */
    this.values = [];
    /** Lowest and highest that is drawn. @type {[number, number]} */
    this.scale = [0, 1];
    /** @type {Reading["signal"]} */
    this.signal = { name: "", type: "number" };
    this.serial = -1;
    this.drawnMs = 0;
    this.limitsShown = "";
    /** uPlot's instance: its types are not part of this page. @type {any} */
    this.plot = null;
    this.isOver = false;
    // The line moves on with the time, also when nothing comes.
    this.timer = setInterval(() => this.draw(), MOVE_EVERY_MS);
    // Not the cell's size: the figures beside the line take of its width.
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
        // Asked anew for each drawing, so that the line follows the theme.
        series: [{}, { stroke: () => getComputedStyle(this.place).color, width: 2, points: { show: false } }],
      };
      this.plot = new Plot(options, [this.times, this.values], this.place);
      this.sizes.observe(this.place);
    } catch (error) {
      // The number is the widget; the line is an extra that some installations don't have.
      console.info("value: no history is drawn:", error);
      if (this.root instanceof HTMLElement) this.root.hidden = true;
    }
  }

  /** @param {Reading} reading */
  add({ value, state, signal, serial, time }) {
    this.signal = signal;
    const last = this.times.at(-1) ?? -Infinity;
    if (state !== "live" || typeof value !== "number") {
      if ((this.values.at(-1) ?? null) !== null) this.push(last + 1e-3, null);
      this.draw();
    } else if (serial !== this.serial) {
      this.serial = serial;
      // At most POINTS in the window: newer readings replace the last point in between.
      const isClose = time - last < this.windowS / POINTS && typeof this.values.at(-1) === "number";
      if (isClose || time <= last) this.values[this.values.length - 1] = value;
      else this.push(time, value);
      if (performance.now() - this.drawnMs > DRAW_EVERY_MS) this.draw();
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
    // The last point before the window stays: from there the line comes in. A gap needs no start.
    while ((this.times[1] ?? Infinity) < startS) this.drop();
    if (this.times.length === 1 && (this.times[0] ?? 0) < startS) this.drop();
    const known = this.values.filter((value) => value !== null);
    const limits = Object.entries(this.signal.limits ?? {});
    const ends = scaleOf(known, limits.map(([, limit]) => limit));
    const rim = (ends[1] - ends[0]) * RIM;
    this.scale = [ends[0] - rim, ends[1] + rim];
    write(this.least, known.length > 0 ? this.figure(ends[0]) : "");
    write(this.most, known.length > 0 ? this.figure(ends[1]) : "");
    this.drawLimits(known.length > 0 ? limits : []);
    this.plot?.setData([this.times, this.values]);
  }

  /** @param {number} value */
  figure(value) {
    const { precision } = this.signal;
    return precision === undefined ? String(Number(value.toPrecision(4))) : value.toFixed(precision);
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

/**
 * What is drawn from bottom to top: all values, and the next limits where they are not so far off
 * that the line would become flat.
 *
 * @param {number[]} values
 * @param {number[]} limits
 * @returns {[number, number]}
 */
function scaleOf(values, limits) {
  if (values.length === 0) return [0, 1];
  let least = Math.min(...values);
  let most = Math.max(...values);
  if (least === most) {
    const room = Math.abs(most) / 10 || 1;
    [least, most] = [least - room, most + room];
  }
  const near = NEAR * (most - least);
  const above = Math.min(...limits.filter((limit) => limit > most && limit <= most + near));
  const below = Math.max(...limits.filter((limit) => limit < least && limit >= least - near));
  return [Number.isFinite(below) ? below : least, Number.isFinite(above) ? above : most];
}

/** @param {Element} place */
function sizeOf(place) {
  return { width: Math.max(1, place.clientWidth), height: Math.max(1, place.clientHeight) };
}

/**
 * @param {unknown} text as "60s" or "5min"
 * @returns {number} seconds; 0 when there is none
 */
function seconds(text) {
  const match = /^(\d+)(s|min)$/.exec(String(text ?? ""));
  return match ? Number(match[1]) * (match[2] === "min" ? 60 : 1) : 0;
}

/**
 * Tell the style sheet how many characters must fit, in steps, so that 9.9 → 10.0 changes nothing.
 *
 * @param {Element} line
 * @param {number} characters
 */
function fitText(line, characters) {
  const step = String(Math.min(40, Math.max(4, 2 * Math.ceil(characters / 2))));
  if (!(line instanceof HTMLElement)) return;
  if (line.style.getPropertyValue("--value-characters") === step) return;
  line.style.setProperty("--value-characters", step);
}

/**
 * @param {Reading} reading
 * @param {unknown} precision
 */
function textOf(reading, precision) {
  const { value } = reading;
  if (typeof precision === "number" && typeof value === "number") return value.toFixed(precision);
  if (typeof value === "boolean" && reading.text === String(value)) return value ? "yes" : "no";
  return reading.text;
}

/** @param {Reading} reading */
function noteOf(reading) {
  if (reading.state === "none") return "no value yet";
  if (reading.state === "gone") return `last seen ${reading.age} ago`;
  const old = reading.state === "stale" ? `${reading.age} old` : "";
  return [ALARMS[reading.alarm], old].filter(Boolean).join(" · ");
}

/**
 * @param {Element} root
 * @param {string} selector
 */
function find(root, selector) {
  const found = root.querySelector(selector);
  if (!found) throw new Error(`the template has no ${selector}`);
  return found;
}

/**
 * @param {Element} el
 * @param {string} text
 */
function write(el, text) {
  if (el.textContent !== text) el.textContent = text;
}

/**
 * @param {Element} el
 * @param {string} name
 * @param {string} value
 */
function attribute(el, name, value) {
  if (el.getAttribute(name) !== value) el.setAttribute(name, value);
}
