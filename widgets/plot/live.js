// @ts-check
/**
 * The live traces: each frame the picture moves to the left and only what is new is drawn.
 *
 * Drawing everything anew costs twenty times as much. That is done when the scale has changed, the
 * size, or the colours.
 *
 * @typedef {import("./traces.js").Ring} Ring
 * @typedef {{ring: Ring, colour: string, dash: number[], isShown: boolean, drawn: number,
 *   way: number}} Trace `drawn` is how many readings are in the picture, `way` how far its dashes are.
 */

const MAX_DENSITY = 2;
/** New readings within one column of pixels wait for each other, but no longer than this. */
const WAIT_S = 0.05;

export class Live {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {number} spanS seconds from left to right
   */
  constructor(canvas, spanS) {
    this.canvas = canvas;
    this.spanS = spanS;
    const context = canvas.getContext("2d");
    if (!context) throw new Error("this browser draws no canvas");
    this.context = context;
    /** @type {Trace[]} */
    this.traces = [];
    /** @type {[number, number]} */
    this.scale = [0, 1];
    this.column = 0;
    this.drawnS = 0;
    this.density = 1;
    this.isStale = true;
  }

  /** @param {{width: number, height: number}} size in CSS pixels */
  resize({ width, height }) {
    this.density = Math.min(MAX_DENSITY, globalThis.devicePixelRatio || 1);
    this.canvas.width = Math.max(1, Math.round(width * this.density));
    this.canvas.height = Math.max(1, Math.round(height * this.density));
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
    const shift = column - this.column;
    if (shift === 0 && !this.isStale && nowS - this.drawnS < WAIT_S) return;
    this.column = column;
    this.drawnS = nowS;
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
    const { ring } = trace;
    if (trace.drawn >= ring.count) return;
    const start = Math.max(ring.first, trace.drawn - 1);
    const { context } = this;
    const { width, height } = this.canvas;
    const [least, most] = this.scale;
    const factor = height / (most - least);
    context.beginPath();
    let [wasX, wasY, way] = [NaN, NaN, 0];
    for (let number = start; number < ring.count; number += 1) {
      const value = ring.value(number);
      const x = width - 1 - (this.column - ring.time(number) * perSecond);
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
    trace.drawn = ring.count;
    if (trace.isShown) {
      context.strokeStyle = trace.colour;
      context.lineWidth = 2 * this.density;
      context.lineJoin = "round";
      context.setLineDash(trace.dash.map((length) => length * this.density));
      context.lineDashOffset = trace.way;
      context.stroke();
    }
    trace.way += way;
  }
}
