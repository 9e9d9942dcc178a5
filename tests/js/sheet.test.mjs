// A canvas that is drawn on out of sight, and shown when it is done.
import assert from "node:assert/strict";
import { afterEach, test } from "node:test";

import { board } from "../../urc/web/static/widgets/kit.js";
import { Sheet } from "../../urc/web/static/widgets/offscreen_canvas.js";

/** A pen that writes down what is drawn. */
class Pen {
  /** @type {string[]} */
  strokes = [];
  save() {}
  restore() {}
  setTransform() {}
  clearRect() {
    this.strokes = [];
  }
  /** @param {{strokes: string[]}} picture */
  drawImage(picture) {
    this.strokes.push(...picture.strokes);
  }
  /** @param {string} what */
  stroke(what) {
    this.strokes.push(what);
  }
}

class Hidden {
  pen = new Pen();
  width = 0;
  height = 0;
  getContext() {
    return this.pen;
  }
  transferToImageBitmap() {
    const picture = { strokes: this.pen.strokes };
    this.pen.strokes = [];
    return picture;
  }
}

/** A canvas of the page; `shown` has the pictures that were handed over. */
function made() {
  /** @type {string[][]} */
  const shown = [];
  const pen = new Pen();
  const screen = { transferFromImageBitmap: (/** @type {{strokes: string[]}} */ picture) => shown.push([...picture.strokes]) };
  const getContext = (/** @type {string} */ kind) => (kind === "2d" ? pen : screen);
  return { canvas: /** @type {any} */ ({ width: 1, height: 1, getContext }), shown, pen };
}

const globals = /** @type {any} */ (globalThis);
const soon = () => new Promise((resolve) => setImmediate(resolve));

afterEach(() => {
  delete globals.OffscreenCanvas;
});

test("what is drawn is shown when it is handed over, and then the sheet is empty", () => {
  globals.OffscreenCanvas = Hidden;
  const { canvas, shown } = made();
  const sheet = new Sheet(canvas);
  const pen = /** @type {any} */ (sheet.pen);
  sheet.resize(30, 20);
  pen.stroke("one");
  assert.deepEqual(shown, []);
  sheet.show();
  pen.stroke("two");
  sheet.show();
  assert.deepEqual(shown, [["one"], ["two"]]);
  assert.deepEqual([canvas.width, canvas.height, sheet.surface.width], [30, 20, 30]);
});

test("what is kept is drawn on", () => {
  globals.OffscreenCanvas = Hidden;
  const { canvas, shown } = made();
  const sheet = new Sheet(canvas);
  const pen = /** @type {any} */ (sheet.pen);
  pen.stroke("one");
  sheet.show(true);
  pen.stroke("two");
  sheet.show(true);
  assert.deepEqual(shown, [["one"], ["one", "two"]]);
});

test("a board that is drawn twice at once is handed over once, as it was drawn last", async () => {
  globals.OffscreenCanvas = Hidden;
  const { canvas, shown } = made();
  for (const what of ["first", "second"]) {
    /** @type {any} */ (board(canvas, { width: 30, height: 20 })).stroke(what);
  }
  assert.deepEqual(shown, []);
  await soon();
  assert.deepEqual(shown, [["second"]]);
  /** @type {any} */ (board(canvas, { width: 30, height: 20 })).stroke("third");
  await soon();
  assert.deepEqual(shown, [["second"], ["third"]]);
});

test("a browser that knows no hidden canvas draws on the one in the page", async () => {
  const { canvas, shown, pen } = made();
  /** @type {any} */ (board(canvas, { width: 30, height: 20 })).stroke("one");
  await soon();
  assert.deepEqual([pen.strokes, shown], [["one"], []]);
});
