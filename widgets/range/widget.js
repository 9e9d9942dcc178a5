// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./sight.js").Bounds} Bounds */
/** @typedef {import("./sight.js").Kind} Kind */
/** @typedef {{value: unknown, reading: Reading}} Sensor */
import { DASH, attribute, board, colours, digitsIn, format, many, noteOf, number, part, svg, write } from "urc/kit";
import { Track, bearings, besides, kindOf, nearestOf, sector, shareOf, sideOf, zoneOf } from "./sight.js";

const WINDOW_S = 60;
const RADIUS = 100;
const VEHICLE = 26;
const INK = /** @type {const} */ (["level", "caution", "alarm", "line", "faint", "muted"]);

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const view = new View(ctx);
    ctx.follow("theme", () => view.theme());
    return {
      update(readings) {
        view.update(readings["range"], many(readings["others"]), readings);
      },
      resize() {
        view.drawGraph();
      },
      destroy() {
        clearInterval(view.timer);
      },
    };
  },
};

class View {
  /** @param {Context} ctx */
  constructor({ el, options, t, unit }) {
    this.t = t;
    this.unit = unit;
    this.options = options;
    this.root = part(el, ".range");
    this.text = part(el, ".range-text");
    this.symbol = part(el, ".range-unit");
    this.note = part(el, ".range-note");
    this.cones = el.querySelector(".range-cones");
    this.rings = el.querySelector(".range-rings");
    this.graph = el.querySelector("canvas");
    this.ink = colours(el, INK);
    this.track = new Track(WINDOW_S);
    this.drawn = "";
    /** Number of distances in the last value of the first input. */
    this.count = 1;
    this.state = "none";
    // The line advances with time, even without readings.
    this.timer = this.graph ? setInterval(() => this.drawGraph(), 1000) : undefined;
  }

  theme() {
    this.ink = colours(this.root, INK);
    this.drawGraph();
  }

  /**
   * @param {Readonly<Record<string, Reading>>} readings
   * @returns {Bounds}
   */
  bounds(readings) {
    const option = (/** @type {string} */ name) => {
      const value = this.options[name];
      return typeof value === "number" ? value : null;
    };
    return {
      min: number(readings["min_range"]) ?? option("min"),
      max: number(readings["max_range"]) ?? option("max"),
      near: option("near"),
      stop: option("stop"),
    };
  }

  /**
   * @param {Reading | undefined} reading
   * @param {readonly Reading[]} others
   * @param {Readonly<Record<string, Reading>>} readings
   */
  update(reading, others, readings) {
    if (!reading) return;
    const bounds = this.bounds(readings);
    const sensors = this.sensors(reading, others);
    const places = this.places(sensors.length);
    const nearest = nearestOf(sensors.map((each) => each.value), bounds);
    const shown = sensors[nearest] ?? { value: null, reading };
    const kind = kindOf(shown.value, bounds);
    this.state = shown.reading.state;
    attribute(this.root, "data-state", this.state);
    attribute(this.root, "data-zone", zoneOf(shown.value, bounds));
    write(this.text, this.words(kind, shown.value, bounds, shown.reading));
    write(this.symbol, kind === "unknown" || kind === "clear" ? "" : this.unit("range").symbol);
    const sides = places.map((place) => this.t(sideOf(place)));
    const said = sensors.map((each) => this.lossOf(each, bounds));
    const alarm = noteOf({ ...shown.reading, state: "live", age: "" }, this.t);
    const side = sensors.length > 1 && kind !== "unknown" ? (sides[nearest] ?? "") : "";
    const own = [this.zoneText(shown.value, bounds, kind), side, alarm, this.lossOf(shown, bounds)];
    const notes = [...own, ...besides(sides, said, nearest)];
    write(this.note, notes.filter(Boolean).join(" · "));
    this.draw(sensors, places, bounds);
    const isLive = this.state === "live" && kind !== "unknown";
    const timeS = Math.max(reading.time, ...sensors.map((each) => each.reading.time));
    if (this.graph) this.track.add(timeS, isLive ? shareOf(shown.value, bounds) : null);
    this.drawGraph();
  }

  /**
   * Return every distance with its reading.
   *
   * @param {Reading} reading
   * @param {readonly Reading[]} others
   * @returns {Sensor[]}
   */
  sensors(reading, others) {
    const { value } = reading;
    if (Array.isArray(value)) this.count = value.length;
    // A missing value contains no count, so the number and directions of the sensors stay.
    const first = Array.isArray(value) ? value : value === null ? Array(this.count).fill(null) : [value];
    return [
      ...first.map((each) => ({ value: each, reading })),
      ...others.map((each) => ({ value: each.value, reading: each })),
    ];
  }

  /**
   * Return why the distance of a sensor is unknown, or "".
   *
   * @param {Sensor} sensor
   * @param {Bounds} bounds
   */
  lossOf({ value, reading: { state, age } }, bounds) {
    if (state !== "live") return noteOf({ state, age, alarm: "" }, this.t);
    return kindOf(value, bounds) === "unknown" ? this.t("not known") : "";
  }

  /** @param {number} count */
  places(count) {
    const given = this.options["bearings"];
    return bearings(Array.isArray(given) ? given : [], count);
  }

  /**
   * @param {Kind} kind
   * @param {unknown} value
   * @param {Bounds} bounds
   * @param {Reading} reading
   */
  words(kind, value, bounds, reading) {
    const shown = (/** @type {number} */ distance) => {
      const precision = Number(this.options["precision"] ?? reading.signal.precision ?? 2);
      const { factor } = this.unit("range");
      return format(factor(distance), digitsIn(precision, factor));
    };
    if (kind === "clear") return this.t("clear");
    if (kind === "close") return `< ${shown(bounds.min ?? 0)}`;
    return kind === "in" && typeof value === "number" ? shown(value) : DASH;
  }

  /**
   * @param {unknown} value
   * @param {Bounds} bounds
   * @param {Kind} kind
   */
  zoneText(value, bounds, kind) {
    const zone = zoneOf(value, bounds);
    if (kind === "close") return `▲ ${this.t("too close")}`;
    if (zone === "stop") return `▲ ${this.t("very near")}`;
    return zone === "near" ? `◆ ${this.t("near")}` : "";
  }

  /**
   * @param {readonly Sensor[]} sensors
   * @param {readonly number[]} places
   * @param {Bounds} bounds
   */
  draw(sensors, places, bounds) {
    const { cones, rings } = this;
    if (!cones || !rings) return;
    const look = JSON.stringify([sensors.map(({ value, reading }) => [value, reading.state]), bounds]);
    if (look === this.drawn) return;
    this.drawn = look;
    const isRing = this.options["view"] === "ring";
    const width = Number(this.options["field_of_view"] ?? 30);
    const from = isRing ? VEHICLE : 0;
    const marks = [0.25, 0.5, 0.75, 1].map((share) => {
      const radius = from + share * (RADIUS - from);
      if (isRing) return svg("circle", { class: "range-ring", cx: 0, cy: 0, r: radius });
      return svg("path", { class: "range-ring", d: sector(0, 180, 0, radius) });
    });
    rings.replaceChildren(...marks);
    const made = sensors.flatMap(({ value, reading: { state } }, index) => {
      const kind = kindOf(value, bounds);
      const bearing = isRing ? (places[index] ?? 0) : 0;
      if (!isRing && index > 0) return [];
      const reach = from + shareOf(value, bounds) * (RADIUS - from);
      const all = svg("path", { class: "range-view", d: sector(bearing, width, from, RADIUS) });
      const free = svg("path", {
        class: "range-free",
        d: sector(bearing, width, from, Math.max(from + 0.5, reach)),
        "data-kind": kind,
        "data-zone": zoneOf(value, bounds),
      });
      // An obstacle is a thick edge, visible without colour.
      const inner = Math.max(from, reach - 4);
      const wall = svg("path", {
        class: "range-wall",
        d: sector(bearing, width, inner, inner + 5),
        "data-zone": zoneOf(value, bounds),
        "data-state": state,
      });
      if (kind === "unknown") return [all];
      return kind === "clear" ? [all, free] : [all, free, wall];
    });
    cones.replaceChildren(...made);
  }

  drawGraph() {
    const { graph, ink, track } = this;
    if (!graph) return;
    const [width, height] = [graph.clientWidth, graph.clientHeight];
    if (width === 0 || height === 0) return;
    const pen = board(graph, { width, height });
    const endS = performance.now() / 1000;
    pen.strokeStyle = ink.faint;
    pen.lineWidth = 1;
    for (const share of [0.25, 0.5, 0.75]) {
      pen.beginPath();
      pen.moveTo(0, height * share);
      pen.lineTo(width, height * share);
      pen.stroke();
    }
    pen.strokeStyle = this.state === "live" ? ink.level : ink.muted;
    pen.lineWidth = 2;
    pen.beginPath();
    let isOn = false;
    for (const [timeS, share] of track.points) {
      const x = width * (1 - (endS - timeS) / WINDOW_S);
      if (share === null) isOn = false;
      else {
        const y = 1 + (height - 2) * (1 - share);
        if (isOn) pen.lineTo(x, y);
        else pen.moveTo(x, y);
        isOn = true;
      }
    }
    pen.stroke();
  }
}
