// @ts-check
/**
 * The live traces. In each frame, the picture moves to the left, and new data is drawn at its right end
 * on a narrow canvas that moves with the picture. A full narrow canvas is copied into the picture.
 *
 * A complete redraw takes much longer, and is only done after a change of the scale, the size or the
 * colours.
 *
 * @typedef {import("./picture.js").Strip} Strip
 * @typedef {import("./traces.js").Ring} Ring
 *
 * @typedef {object} Trace
 * @property {Ring} ring
 * @property {string} colour
 * @property {number[]} dash
 * @property {boolean} isShown
 * @property {number} kept Number of readings in the picture.
 * @property {number} keptWay Length of the dash pattern there, in pixels.
 * @property {number} drawn Number of readings in the picture and on the narrow canvas.
 * @property {number} drawnWay
 */
import { Picture } from "./picture.js";

const MAX_DENSITY = 2;
/** Longest time for which new readings in one pixel column are collected. */
const WAIT_S = 0.05;

export class Live {
  /**
   * @param {HTMLElement} place element of the picture
   * @param {number} spanS seconds from left to right
   */
  constructor(place, spanS) {
    this.picture = new Picture(place);
    this.spanS = spanS;
    /** @type {Trace[]} */
    this.traces = [];
    /** @type {[number, number]} */
    this.scale = [0, 1];
    /** Column at the right end. */
    this.column = 0;
    this.drawnS = 0;
    this.isStale = true;
  }

  /** @param {{width: number, height: number}} size in CSS pixels */
  resize({ width, height }) {
    this.picture.resize(width, height, Math.min(MAX_DENSITY, globalThis.devicePixelRatio || 1));
    this.isStale = true;
  }

  /** Redraw everything in the next frame. */
  spoil() {
    this.isStale = true;
  }

  /** @param {number} nowS */
  frame(nowS) {
    const { width } = this.picture;
    const perSecond = width / this.spanS;
    const column = Math.floor(nowS * perSecond);
    const shift = column - this.column;
    if (shift === 0 && !this.isStale && nowS - this.drawnS < WAIT_S) return;
    this.column = column;
    this.drawnS = nowS;
    const isAnew = this.isStale || shift >= width || shift < 0;
    this.isStale = false;
    if (isAnew) this.begin(nowS - this.spanS);
    if (isAnew || !this.fits(perSecond)) this.keep(perSecond);
    else this.draw(perSecond);
    this.picture.show(column);
  }

  /** Clear the picture. @param {number} startS start of the visible range */
  begin(startS) {
    this.picture.wipe();
    for (const trace of this.traces) {
      trace.kept = trace.ring.since(startS);
      trace.keptWay = 0;
    }
  }

  /** Return whether all new data fits on the narrow canvas. @param {number} perSecond */
  fits(perSecond) {
    const { from, to } = this.picture.newest;
    if (this.column >= to) return false;
    return this.traces.every(({ ring, drawn }) => {
      return drawn >= ring.count || ring.time(Math.max(ring.first, drawn - 1)) * perSecond >= from;
    });
  }

  /** Draw new data on the narrow canvas. @param {number} perSecond */
  draw(perSecond) {
    for (const trace of this.traces) {
      const { ring, drawn } = trace;
      const [first, last] = [Math.max(ring.first, drawn - 1), ring.count - 1];
      if (drawn >= ring.count) continue;
      this.line(this.picture.newest, trace, first, last, perSecond, trace.drawnWay);
      trace.drawnWay += this.wayOf(trace, first, last, perSecond);
      trace.drawn = ring.count;
    }
  }

  /** Add new data to the picture, starting at its last readings. @param {number} perSecond */
  keep(perSecond) {
    for (const trace of this.traces) {
      const { ring, kept } = trace;
      const last = ring.count - 1;
      let at = Math.max(ring.first, kept - 1);
      const [start, end] = [ring.time(at) * perSecond, ring.time(last) * perSecond];
      const strips = kept < ring.count ? this.picture.between(start, end, this.column) : [];
      for (const strip of strips) {
        const first = Math.max(at, ring.since(strip.from / perSecond));
        trace.keptWay += this.wayOf(trace, at, first, perSecond);
        at = first;
        this.line(strip, trace, at, Math.min(last, ring.since(strip.to / perSecond) + 1), perSecond, trace.keptWay);
      }
      trace.keptWay += this.wayOf(trace, at, last, perSecond);
      [trace.kept, trace.drawn, trace.drawnWay] = [ring.count, ring.count, trace.keptWay];
    }
    this.picture.follow(this.column);
  }

  /**
   * Return the length of a line between two readings in pixels, for the dash pattern.
   *
   * @param {Trace} trace
   * @param {number} from
   * @param {number} to
   * @param {number} perSecond
   */
  wayOf({ ring, dash }, from, to, perSecond) {
    if (dash.length === 0) return 0;
    const [least, most] = this.scale;
    const factor = this.picture.height / (most - least);
    let way = 0;
    for (let number = from + 1; number <= to; number += 1) {
      const across = (ring.time(number) - ring.time(number - 1)) * perSecond;
      const down = (ring.value(number) - ring.value(number - 1)) * factor;
      if (!Number.isNaN(down)) way += Math.hypot(across, down);
    }
    return way;
  }

  /**
   * @param {Strip} strip
   * @param {Trace} trace
   * @param {number} first number of the first reading
   * @param {number} last
   * @param {number} perSecond pixels
   * @param {number} way offset of its dashes
   */
  line(strip, { ring, isShown, colour, dash }, first, last, perSecond, way) {
    if (!isShown) return;
    strip.isDrawn = true;
    const { pen } = strip.sheet;
    const { height, density } = this.picture;
    const [least, most] = this.scale;
    const factor = height / (most - least);
    let isGap = true;
    pen.beginPath();
    for (let number = first; number <= last; number += 1) {
      const value = ring.value(number);
      const wasGap = isGap;
      isGap = Number.isNaN(value);
      if (isGap) continue;
      const x = ring.time(number) * perSecond - strip.from;
      const y = height - (value - least) * factor;
      if (wasGap) pen.moveTo(x, y);
      else pen.lineTo(x, y);
    }
    pen.strokeStyle = colour;
    pen.lineWidth = 2 * density;
    pen.lineJoin = "round";
    // Separate pieces have no joints; round caps look the same.
    pen.lineCap = dash.length === 0 ? "round" : "butt";
    pen.setLineDash(dash.map((length) => length * density));
    pen.lineDashOffset = way;
    pen.stroke();
  }
}
