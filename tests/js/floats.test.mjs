// The captions and buttons of the background find a free place.
import assert from "node:assert/strict";
import { test } from "node:test";

import { freeShift } from "../../urc/web/static/live/floats.js";

const ROOM = { left: 0, top: 50, right: 800, bottom: 600 };
const box = (/** @type {number} */ left, /** @type {number} */ top, width = 100, height = 40) => {
  return { left, top, right: left + width, bottom: top + height };
};

test("a float that nothing covers stays in its place", () => {
  assert.deepEqual(freeShift(box(350, 60), [box(0, 60), box(700, 60), box(350, 200)], ROOM), [0, 0]);
});

test("a caption below a button moves by as little as possible", () => {
  assert.deepEqual(freeShift(box(350, 60), [box(340, 55)], ROOM), [0, 41]);
  const two = [box(340, 55), box(340, 100)];
  assert.deepEqual(freeShift(box(350, 60), two, ROOM), [0, 86], "the next place is taken, too");
});

test("a float moves to the side if that is shorter", () => {
  assert.deepEqual(freeShift(box(350, 60), [box(280, 55, 100, 300)], ROOM), [36, 0]);
  assert.deepEqual(freeShift(box(350, 60), [box(420, 55, 100, 300)], ROOM), [-36, 0]);
});

test("a column of buttons moves up if that is shorter, but not out of the stage", () => {
  assert.deepEqual(freeShift(box(0, 200, 44, 132), [box(0, 300)], ROOM), [0, -38]);
  assert.deepEqual(freeShift(box(0, 60, 44, 132), [box(0, 150, 300, 60)], ROOM), [0, 156]);
});

test("a float moves both ways around a corner", () => {
  const wall = [box(0, 60, 500, 300), box(500, 60, 300, 60)];
  assert.deepEqual(freeShift(box(420, 70), wall, ROOM), [86, 56]);
});

test("a float without any free place stays", () => {
  assert.deepEqual(freeShift(box(0, 100), [box(0, 50, 800, 550)], ROOM), [0, 0]);
});
