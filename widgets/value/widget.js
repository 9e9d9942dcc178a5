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
    const history = place instanceof HTMLElement && windowS ? new History(place, windowS) : null;
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
      resize() {
        history?.fit();
      },
    };
  },
};

/** The last minutes as a line, drawn by uPlot where the build has brought it. */
class History {
  /**
   * @param {HTMLElement} place
   * @param {number} windowS
   */
  constructor(place, windowS) {
    this.place = place;
    this.windowS = windowS;
    /** @type {number[]} */
    this.times = [];
    /** @type {(number | null)[]} */
    this.values = [];
    this.serial = -1;
    this.drawnMs = 0;
    /** uPlot's instance: its types are not part of this page. @type {any} */
    this.plot = null;
    this.isOver = false;
    void this.load();
  }

  async load() {
    try {
      const name = "uplot";
      const { default: Plot } = await import(name);
      if (this.isOver) return;
      this.plot = new Plot(plotOptions(this.place), [this.times, this.values], this.place);
    } catch (error) {
      // The number is the widget; the line is an extra that some installations don't have.
      console.info("value: no history is drawn:", error);
      this.place.hidden = true;
    }
  }

  /** @param {Reading} reading */
  add(reading) {
    const { value } = reading;
    const isLive = reading.state === "live" && typeof value === "number";
    if (reading.serial === this.serial || !isLive) return;
    this.serial = reading.serial;
    const last = this.times.at(-1) ?? -Infinity;
    // At most POINTS in the window: newer readings replace the last point in between.
    const isClose = reading.time - last < this.windowS / POINTS && this.times.length > 1;
    if (isClose || reading.time <= last) {
      this.values[this.values.length - 1] = value;
    } else {
      this.times.push(reading.time);
      this.values.push(value);
    }
    while ((this.times[0] ?? Infinity) < reading.time - this.windowS) {
      this.times.shift();
      this.values.shift();
    }
    const nowMs = performance.now();
    if (this.plot && nowMs - this.drawnMs > DRAW_EVERY_MS) {
      this.drawnMs = nowMs;
      this.plot.setData([this.times, this.values]);
    }
  }

  fit() {
    this.plot?.setSize(sizeOf(this.place));
  }

  destroy() {
    this.isOver = true;
    this.plot?.destroy();
  }
}

/** @param {HTMLElement} place */
function plotOptions(place) {
  // Asked anew for each drawing, so that the line follows the theme.
  const stroke = () => getComputedStyle(place).color;
  return {
    ...sizeOf(place),
    padding: [4, 4, 4, 4],
    cursor: { show: false },
    legend: { show: false },
    axes: [{ show: false }, { show: false }],
    series: [{}, { stroke, width: 2, points: { show: false } }],
  };
}

/** @param {HTMLElement} place */
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
