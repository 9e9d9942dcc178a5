// The picture of a plot: wherever time stands, all of each line that can be seen is on some canvas.
import assert from "node:assert/strict";
import { test } from "node:test";

const globals = /** @type {any} */ (globalThis);

/** A pen that keeps the pieces of the lines on its canvas, from which column to which. */
class Pen {
  /** @type {[number, number][]} */
  pieces = [];
  x = NaN;
  drawn = 0;
  beginPath() {}
  setLineDash() {}
  stroke() {}
  clearRect() {
    this.pieces = [];
  }
  /** @param {number} x */
  moveTo(x) {
    this.x = x;
  }
  /** @param {number} x */
  lineTo(x) {
    this.pieces.push([this.x, x]);
    this.x = x;
    this.drawn += 1;
  }
}

globals.document = {
  createElement: () => {
    const pen = new Pen();
    return { width: 1, height: 1, style: {}, pen, getContext: () => pen };
  },
};
const { Live } = await import("../../widgets/plot/live.js");
const { Ring } = await import("../../widgets/plot/traces.js");

const WIDTH = 400;
const SPAN_S = 10;

function made() {
  const live = new Live(/** @type {any} */ ({ style: {}, replaceChildren() {} }), SPAN_S);
  const ring = new Ring(2000);
  const trace = { ring, colour: "", dash: [4, 2], isShown: true, kept: 0, keptWay: 0, drawn: 0, drawnWay: 0 };
  live.traces = [trace];
  live.resize({ width: WIDTH, height: 100 });
  return { live, ring, trace };
}

/**
 * Return the columns that are seen, up to the last reading, in which nothing of the line can be seen.
 *
 * @param {InstanceType<typeof Live>} live
 * @param {number} firstS its first reading
 * @param {number} lastS its last one
 */
function missing(live, firstS, lastS) {
  const perSecond = WIDTH / SPAN_S;
  const seen = new Set();
  for (const { sheet, from } of live.picture.all) {
    const { pen, width } = /** @type {any} */ (sheet.canvas);
    for (const [start, end] of pen.pieces) {
      const [left, right] = [Math.max(0, Math.floor(start)), Math.min(width - 1, Math.ceil(end))];
      for (let x = left; x <= right; x += 1) seen.add(Math.floor(from + x));
    }
  }
  const found = [];
  const first = Math.max(Math.ceil(firstS * perSecond), live.column - WIDTH + 1);
  const last = Math.min(Math.floor(lastS * perSecond), live.column - 1); // the last column may wait
  for (let column = first; column <= last; column += 1) {
    if (!seen.has(column)) found.push(column - live.column);
  }
  return found;
}

/**
 * Let time pass, with readings so far apart, and look at the picture in each frame.
 *
 * @param {number} apartS
 * @param {number} tillS
 */
function play(apartS, tillS, frameS = 1 / 60) {
  const { live, ring, trace } = made();
  const beginS = 3.3;
  let nextS = beginS;
  for (let nowS = beginS; nowS < tillS; nowS += frameS) {
    for (; nextS <= nowS; nextS += apartS) ring.push(nextS, Math.sin(nextS));
    live.frame(nowS);
    if (ring.count > 1) assert.deepEqual(missing(live, beginS, ring.time(ring.count - 1)), [], `at ${nowS}`);
  }
  return { live, ring, trace };
}

test("a line of many readings is whole in every frame, over several widths of the picture", () => {
  play(1 / 60, 4 * SPAN_S);
});

test("a line whose readings are far apart is whole as well", () => {
  play(2.7, 4 * SPAN_S);
  play(0.4, 2 * SPAN_S);
});

test("a page that draws seldom misses nothing", () => {
  play(1 / 100, 3 * SPAN_S, 0.9);
});

test("what is drawn once is not drawn again in each frame", () => {
  const { live, ring } = play(1 / 60, 3 * SPAN_S);
  const drawn = live.picture.all.reduce((sum, { sheet }) => sum + /** @type {any} */ (sheet.canvas).pen.drawn, 0);
  assert.ok(drawn < 4 * ring.count, `${drawn} pieces for ${ring.count} readings`);
});

test("after a pause longer than the picture, what is seen is drawn anew", () => {
  const { live, ring } = play(1 / 60, 8);
  const nowS = 8 + 3 * SPAN_S;
  ring.push(nowS - SPAN_S / 2, 1);
  ring.push(nowS - 1, 2);
  live.frame(nowS);
  assert.deepEqual(missing(live, 0, nowS - 1), []);
});

test("dashes come as far in pieces as in one go", () => {
  const { trace, ring, live } = play(1 / 60, 8);
  const whole = live.wayOf(trace, ring.first, ring.count - 1, WIDTH / SPAN_S);
  assert.ok(Math.abs(trace.drawnWay - whole) < 1, `${trace.drawnWay} of ${whole}`);
});
