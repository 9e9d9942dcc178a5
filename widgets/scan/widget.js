// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./fan.js").Fan} Fan */
/** @typedef {import("./fan.js").Fault} Fault */
/** @typedef {import("./paint.js").Ink} Ink */
import { DASH, attribute, colours, format, noteOf, number, part, worst, write } from "urc/kit";
import { palette, pixel } from "urc/colour_map";
import { Sheet } from "urc/offscreen_canvas";
import { Even, Uneven, faultOf } from "./fan.js";
import { Overlay } from "./overlay.js";
import { arc, band, chart, dots, graph, view } from "./paint.js";
import {
  Rim, bearingOfPixels, directions, measured, nearest, rayOfPixels, raysOfColumns, reachOfPixels, rimOf, ringStep, sideOf,
} from "./rays.js";

/** Largest image in pixels; a slow device cannot fill more per frame. */
const MOST_PIXELS = 420;
const INK = /** @type {const} */ (["level", "caution", "alarm", "raised", "faint", "muted", "line", "text", "old"]);
const VIEWS = /** @type {const} */ (["polar", "map", "graph", "depth", "arc"]);
/**
 * Mark a text for the catalogues; it is translated elsewhere.
 *
 * @param {string} text
 */
const mark = (text) => text;
const NAMES = { polar: mark("Dots"), map: mark("Map"), graph: mark("Graph"), depth: mark("Depth"), arc: mark("Arc") };

/** @typedef {typeof VIEWS[number]} ViewName */

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const scan = new Scan(ctx);
    ctx.follow("theme", () => scan.theme());
    return {
      update: (readings) => scan.update(readings),
      resize: () => scan.resize(),
    };
  },
};

/**
 * Return the directions and distances of the pixels of an image.
 *
 * @param {number} size
 */
function placesOf(size) {
  const reach = reachOfPixels(size);
  return { size, reach, bearings: bearingOfPixels(size), band: band(reach, size) };
}

class Scan {
  /** @param {Context} ctx */
  constructor({ el, options, t, unit, signal }) {
    this.t = t;
    this.unit = unit;
    this.options = options;
    this.root = part(el, ".scan");
    this.face = part(el, ".scan-face");
    this.text = part(el, ".scan-text");
    this.note = part(el, ".scan-note");
    this.scale = part(el, ".scan-scale");
    const [data, over] = el.querySelectorAll("canvas");
    if (!data || !over) throw new Error("the template has no canvas");
    this.sheet = new Sheet(data);
    this.overlay = new Overlay(over);
    this.view = VIEWS.find((each) => each === options["view"]) ?? "polar";
    this.palette = palette();
    /** @type {Reading | undefined} */
    this.reading = undefined;
    this.heading = NaN;
    this.serial = -1;
    this.most = 10;
    /** Distance at the rim of the picture; 0 before the first sweep. */
    this.rim = 0;
    this.fitted = new Rim();
    this.distances = new Float32Array(0);
    /** @type {Fan} */
    this.fan = new Even(0, 0, 0);
    /** Key of the inputs of the present fan. */
    this.made = "";
    /** @type {Fault | null} */
    this.fault = null;
    /** Directions and distances of the pixels, for the present size. */
    this.places = placesOf(0);
    /** Look-up tables for the present fan and size. */
    this.tables = {
      key: "",
      ways: directions(this.fan),
      rays: new Uint16Array(0),
    };
    this.image = new ImageData(1, 1);
    this.pixels = new Uint32Array(this.image.data.buffer);
    /** Size of the picture, cached because reading it from the page would force a layout. */
    this.room = { width: 0, height: 0 };
    const sizes = new ResizeObserver(([entry]) => {
      if (!entry) return;
      this.room = { width: Math.round(entry.contentRect.width), height: Math.round(entry.contentRect.height) };
      this.resize();
    });
    sizes.observe(this.face);
    signal.addEventListener("abort", () => sizes.disconnect());
    this.theme();
    if (options["choose"] !== false) this.addButton(signal);
  }

  /** @param {AbortSignal} signal */
  addButton(signal) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "scan-view urc-scene-view";
    button.dataset["floats"] = "";
    const label = () => {
      write(button, this.t(NAMES[this.view]));
      attribute(button, "aria-label", this.t("View: {name}. Change it.", { name: this.t(NAMES[this.view]) }));
    };
    label();
    const next = () => {
      this.view = VIEWS[(VIEWS.indexOf(this.view) + 1) % VIEWS.length] ?? "polar";
      attribute(this.root, "data-view", this.view);
      label();
      this.resize();
    };
    button.addEventListener("click", next, { signal });
    part(this.root, ".scan-tools").append(button);
  }

  theme() {
    const ink = colours(this.root, INK);
    this.css = ink;
    /** @type {Ink} */
    this.ink = {
      wall: pixel(ink.text),
      near: pixel(ink.caution),
      stop: pixel(ink.alarm),
      free: pixel(ink.faint),
      unknown: pixel(ink.muted, 60),
    };
    this.resize();
  }

  resize() {
    this.serial = -1;
    this.draw();
  }

  /** @param {Readonly<Record<string, Reading>>} readings */
  update(readings) {
    const reading = readings["ranges"];
    if (!reading) return;
    this.reading = reading;
    this.heading = number(readings["heading"]) ?? NaN;
    this.most = number(readings["range_max"]) ?? Number(this.options["range_max"] ?? 10);
    this.setFan(reading, readings);
    const { angles } = readings;
    const lead = !angles || reading.value === null ? reading : angles.value === null ? angles : worst([reading, angles]);
    attribute(this.root, "data-state", lead.state);
    attribute(this.root, "data-fault", this.fault ? "yes" : null);
    this.draw();
    this.tell(lead, lead === angles && lead.state === "none" ? this.t("no angles yet") : noteOf(lead, this.t));
  }

  /**
   * Compute the directions of the rays. Without known directions there are no rays: a dot in a wrong
   * place would hide a real obstacle.
   *
   * @param {Reading} reading reading of the distances
   * @param {Readonly<Record<string, Reading>>} readings
   */
  setFan(reading, readings) {
    const ranges = Array.isArray(reading.value) ? reading.value : [];
    const { angles } = readings;
    const ways = Array.isArray(angles?.value) ? angles.value : [];
    this.fault = angles?.value && reading.value ? faultOf(ways, ranges) : null;
    const isPlaced = !this.fault && (!angles || ways.length === ranges.length);
    const count = isPlaced ? ranges.length : 0;
    const option = (/** @type {string} */ name, /** @type {number} */ otherwise) => {
      const given = number(readings[name]) ?? this.options[name];
      return typeof given === "number" ? given : otherwise;
    };
    const start = option("angle_min", -Math.PI);
    const step = option("angle_increment", count > 0 ? (2 * Math.PI) / count : 0);
    const made = angles ? `${count} at ${angles.serial}` : `${count} ${start} ${step}`;
    if (this.made === made) return;
    this.made = made;
    this.fan = angles ? new Uneven(ways.slice(0, count)) : new Even(count, start, step);
    this.distances = new Float32Array(count);
    this.serial = -1;
  }

  draw() {
    const { reading } = this;
    const { width, height } = this.room;
    if (!reading || width === 0 || height === 0) return;
    const isFlat = this.view === "graph" || this.view === "depth";
    if (reading.serial !== this.serial) this.measure(Array.isArray(reading.value) ? reading.value : [], reading.time);
    this.overlay.draw({
      width,
      height,
      view: this.view,
      most: this.rim,
      near: Number(this.options["near"] ?? 0),
      stop: Number(this.options["stop"] ?? 0),
      vehicle: this.options["vehicle"],
      heading: this.heading,
      unit: this.unit("ranges"),
      ink: this.css,
    });
    this.tellScale();
    if (reading.serial === this.serial) return;
    this.serial = reading.serial;
    const scale = Math.min(1, MOST_PIXELS / Math.max(isFlat ? width : Math.min(width, height), 1));
    const across = Math.max(16, Math.round((isFlat ? width : Math.min(width, height)) * scale));
    this.size(across, isFlat ? Math.max(16, Math.round(height * scale)) : across);
    this.makeTables(isFlat);
    this.paint();
    this.sheet.pen.putImageData(this.image, 0, 0);
    this.sheet.show();
  }

  /** Write the distance between two rings next to the picture, where it covers no obstacle. */
  tellScale() {
    const hasRings = this.rim > 0 && (this.view === "polar" || this.view === "map");
    const { symbol, factor } = this.unit("ranges");
    write(this.scale, hasRings ? `◯ ${format(factor(ringStep(this.rim, 4)))} ${symbol}`.trim() : "");
  }

  /**
   * @param {number} width
   * @param {number} height
   */
  size(width, height) {
    if (this.image.width === width && this.image.height === height) return;
    this.sheet.resize(width, height);
    this.image = new ImageData(width, height);
    this.pixels = new Uint32Array(this.image.data.buffer);
  }

  /** @param {boolean} isFlat */
  makeTables(isFlat) {
    const { width } = this.image;
    const key = `${this.view} ${width} ${this.made}`;
    if (key === this.tables.key) return;
    const isWhole = this.view === "map" || this.view === "arc";
    if (isWhole && this.places.size !== width) this.places = placesOf(width);
    const whole = isWhole ? rayOfPixels(this.fan, this.places.bearings) : new Uint16Array(0);
    this.tables = {
      key,
      ways: directions(this.fan),
      rays: isFlat ? raysOfColumns(this.fan, width) : whole,
    };
  }

  /**
   * @param {readonly unknown[]} values
   * @param {number} timeS
   */
  measure(values, timeS) {
    measured(values, Number(this.options["range_min"] ?? 0), this.most, this.distances);
    const isAround = this.view === "polar" || this.view === "map";
    const isFitted = isAround && this.options["fit"] !== false;
    this.rim = isFitted ? this.fitted.follow(rimOf(this.distances, this.most), timeS) : this.most;
  }

  paint() {
    const { pixels, ink, tables, image, distances: all } = this;
    if (!ink) return;
    const near = Number(this.options["near"] ?? 0);
    const limits = { most: this.rim, reach: this.most, near, stop: Number(this.options["stop"] ?? 0) };
    const { width, height } = image;
    if (all.length === 0) pixels.fill(0);
    else if (this.view === "polar") dots(pixels, width, all, tables.ways, limits, ink);
    else if (this.view === "map") chart(pixels, tables.rays, this.places.reach, width, all, limits, ink);
    else if (this.view === "graph") graph(pixels, width, height, all, limits, ink);
    else if (this.view === "depth") view(pixels, width, height, tables.rays, all, limits, this.palette, ink.unknown);
    else arc(pixels, this.places.band, tables.rays, all, limits, this.palette, ink.unknown);
  }

  /**
   * @param {Pick<Reading, "state">} lead reading that determines the state of the sweep
   * @param {string} aged age of the sweep, as text
   */
  tell(lead, aged) {
    const { count } = this.fan;
    const found = count > 0 ? nearest(this.distances, this.fan, this.most) : null;
    const { symbol, factor } = this.unit("ranges");
    const { near, stop } = { near: Number(this.options["near"] ?? 0), stop: Number(this.options["stop"] ?? 0) };
    const zone = !found ? "" : found.distance <= stop || found.distance === 0 ? "stop" : found.distance <= near ? "near" : "";
    attribute(this.root, "data-zone", zone);
    const mark = zone === "stop" ? "▲ " : zone === "near" ? "◆ " : "";
    const isBlind = count > 0 && !found && this.distances.every((each) => each !== each);
    const words = found
      ? `${mark}${found.distance === 0 ? this.t("too close") : `${format(factor(found.distance), 2)} ${symbol}`.trim()} · ${this.t(sideOf(found.angle))}`
      : count === 0 || isBlind ? DASH : this.t("clear");
    write(this.text, words);
    const blind = isBlind && lead.state === "live" ? this.t("not known") : "";
    const fault = this.fault ? this.t(this.fault.text, this.fault.names) : "";
    write(this.note, [blind, fault, aged].filter(Boolean).join(" · "));
  }
}
