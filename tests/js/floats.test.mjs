// The captions and buttons of the background find a free place.
import assert from "node:assert/strict";
import { test } from "node:test";

import { freeShift } from "../../urc/web/static/live/floats.js";

const ROOM = { left: 0, top: 50, right: 800, bottom: 600 };
const box = (/** @type {number} */ left, /** @type {number} */ top, width = 100, height = 40) => {
  return { left, top, right: left + width, bottom: top + height };
};

test("a float that nothing covers stays in its place", () => {
  assert.equal(freeShift(box(350, 60), [box(0, 60), box(700, 60), box(350, 200)], ROOM), 0);
});

test("a caption below a button moves down by as little as possible", () => {
  assert.equal(freeShift(box(350, 60), [box(340, 55)], ROOM), 41);
  assert.equal(freeShift(box(350, 60), [box(340, 55), box(340, 100)], ROOM), 86, "the next place is taken, too");
});

test("a column of buttons moves up if that is shorter, but not out of the stage", () => {
  assert.equal(freeShift(box(0, 200, 44, 132), [box(0, 300)], ROOM), -38);
  assert.equal(freeShift(box(0, 60, 44, 132), [box(0, 150, 100, 60)], ROOM), 156);
});

test("a float without any free place stays", () => {
  assert.equal(freeShift(box(0, 100), [box(0, 50, 100, 550)], ROOM), 0);
});
