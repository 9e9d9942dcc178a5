// @ts-check
/**
 * The live traces: in each frame the picture moves to the left, and what is new is drawn on a narrow
 * canvas at its right end. From time to time that is put into the picture.
 *
 * A canvas of which anything changes is copied as a whole, so the large one rests between. Drawing
 * everything anew costs more by far: that is done when the scale has changed, the size, or the colours.
 *
 * @typedef {import("./traces.js").Ring} Ring
 * @typedef {{ring: Ring, colour: string, dash: number[], isShown: boolean, drawn: number,
 *   way: number}} Trace `drawn` is how many readings are in the picture, `way` how far its dashes are.
 */

const MAX_DENSITY = 2;
/** New readings within one column of pixels wait for each other, but no longer than this. */
const WAIT_S = 0.05;
/** Width of what is new, in CSS pixels. */
const NEW_PX = 32;
/** More new readings than these are put into the picture. */
const MOST_NEW = 400;

export class Live {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {HTMLCanvasElement} newest at its right end
   * @param {number} spanS seconds from left to right
   */
  constructor(canvas, newest, spanS) {
    this.canvas = canvas;
    this.newest = newest;
    this.spanS = spanS;
    this.context = penOf(canvas);
    this.newPen = penOf(newest);
    /** @type {Trace[]} */
    this.traces = [];
    /** @type {[number, number]} */
    this.scale = [0, 1];
    /** Of the picture, and of what is seen. */
    this.column = 0;
    this.seenColumn = 0;
    this.shift = 0;
    this.hasNew = false;
    this.drawnS = 0;
    this.density = 1;
    this.isStale = true;
  }

  /** @param {{width: number, height: number}} size in CSS pixels */
  resize({ width, height }) {
    this.density = Math.min(MAX_DENSITY, globalThis.devicePixelRatio || 1);
    this.canvas.width = Math.max(1, Math.round(width * this.density));
    this.canvas.height = Math.max(1, Math.round(height * this.density));
    this.newest.width = Math.max(1, Math.min(this.canvas.width, Math.round(NEW_PX * this.density)));
    this.newest.height = this.canvas.height;
    this.newest.style.width = `${this.newest.width / this.density}px`;
    this.isStale = true;
  }

  /** Draw all of it in the next frame. */
  spoil() {
    this.isStale = true;
  }

  /** @param {number} nowS */
  frame(nowS) {
    const { width } = this.canvas;
    const perSecond = width / this.spanS;
    const column = Math.floor(nowS * perSecond);
    if (column === this.seenColumn && !this.isStale && nowS - this.drawnS < WAIT_S) return;
    this.seenColumn = column;
    this.drawnS = nowS;
    const shift = column - this.column;
    if (!this.isStale && this.fits(shift, perSecond)) {
      this.move(shift);
      this.drawNew(perSecond);
      return;
    }
    this.column = column;
    this.move(0);
    this.wipeNew();
    if (this.isStale || shift >= width || shift < 0) {
      this.isStale = false;
      this.redraw(nowS - this.spanS, perSecond);
      return;
    }
    if (shift > 0) {
      this.context.globalCompositeOperation = "copy"; // wipes what is not covered
      this.context.drawImage(this.canvas, -shift, 0);
      this.context.globalCompositeOperation = "source-over";
    }
    for (const trace of this.traces) this.draw(trace, perSecond);
  }

  /**
   * Whether what is new has its place on the narrow canvas.
   *
   * @param {number} shift pixels by which the picture is behind
   * @param {number} perSecond
   */
  fits(shift, perSecond) {
    const room = this.newest.width - Math.ceil(3 * this.density);
    if (shift < 0 || shift >= room) return false;
    let count = 0;
    for (const { ring, drawn } of this.traces) {
      if (drawn >= ring.count) continue;
      count += ring.count - drawn;
      const start = ring.time(Math.max(ring.first, drawn - 1));
      if (this.seenColumn - start * perSecond >= room) return false;
    }
    return count <= MOST_NEW;
  }

  /** @param {number} shift pixels */
  move(shift) {
    if (shift === this.shift) return;
    this.shift = shift;
    this.canvas.style.transform = shift === 0 ? "" : `translateX(${-shift / this.density}px)`;
  }

  wipeNew() {
    if (this.hasNew) this.newPen.clearRect(0, 0, this.newest.width, this.newest.height);
    this.hasNew = false;
  }

  /** @param {number} perSecond */
  drawNew(perSecond) {
    this.wipeNew();
    for (const trace of this.traces) {
      if (trace.drawn >= trace.ring.count) continue;
      this.hasNew = true;
      this.line(this.newPen, trace, this.newest.width - 1 - this.seenColumn, perSecond);
    }
  }

  /**
   * @param {number} startS
   * @param {number} perSecond
   */
  redraw(startS, perSecond) {
    this.context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    for (const trace of this.traces) {
      trace.drawn = trace.ring.since(startS);
      trace.way = 0;
      this.draw(trace, perSecond);
    }
  }

  /**
   * Draw what has not been drawn, from the last reading that was.
   *
   * @param {Trace} trace
   * @param {number} perSecond pixels
   */
  draw(trace, perSecond) {
    if (trace.drawn >= trace.ring.count) return;
    trace.way += this.line(this.context, trace, this.canvas.width - 1 - this.column, perSecond);
    trace.drawn = trace.ring.count;
  }

  /**
   * Draw what is not in the picture.
   *
   * @param {CanvasRenderingContext2D} context
   * @param {Trace} trace
   * @param {number} left pixels from the canvas's left to time 0
   * @param {number} perSecond pixels
   * @returns {number} how long the line is, in pixels
   */
  line(context, trace, left, perSecond) {
    const { ring } = trace;
    const start = Math.max(ring.first, trace.drawn - 1);
    const { height } = this.canvas;
    const [least, most] = this.scale;
    const factor = height / (most - least);
    context.beginPath();
    let [wasX, wasY, way] = [NaN, NaN, 0];
    for (let number = start; number < ring.count; number += 1) {
      const value = ring.value(number);
      const x = left + ring.time(number) * perSecond;
      const y = height - (value - least) * factor;
      if (Number.isNaN(value)) {
        wasX = NaN;
        continue;
      }
      if (Number.isNaN(wasX)) context.moveTo(x, y);
      else {
        context.lineTo(x, y);
        way += Math.hypot(x - wasX, y - wasY);
      }
      [wasX, wasY] = [x, y];
    }
    if (trace.isShown) {
      context.strokeStyle = trace.colour;
      context.lineWidth = 2 * this.density;
      context.lineJoin = "round";
      context.setLineDash(trace.dash.map((length) => length * this.density));
      context.lineDashOffset = trace.way;
      context.stroke();
    }
    return way;
  }
}

/** @param {HTMLCanvasElement} canvas */
function penOf(canvas) {
  const context = canvas.getContext("2d");
  if (!context) throw new Error("this browser draws no canvas");
  return context;
}
