// The rows of the widget `transforms`.
import assert from "node:assert/strict";
import { test } from "node:test";

import { filtered, framesOf, placeOf } from "../../widgets/transforms/frames.js";

const TREE = {
  frames: [
    { name: "map", parent: "", depth: 0 },
    { name: "odom", parent: "map", depth: 1, translation: [1, -2.005, 0], rotation: [0, 0, 0.7071, 0.7071], age: 0.1 },
    { name: "laser", parent: "odom", depth: 2, translation: [0, 0, 0.2], rotation: [1, 0, 0, 0], age: null, other_parent: "map" },
  ],
};

test("frames are read in the server's order", () => {
  const frames = framesOf(TREE);
  assert.deepEqual(frames.map(({ name, depth, age, rival }) => [name, depth, age, rival]), [
    ["map", 0, null, ""],
    ["odom", 1, 0.1, ""],
    ["laser", 2, null, "map"],
  ]);
});

test("a position is in metres, a yaw in degrees, and zero has no sign", () => {
  const [root, odom, laser] = framesOf(TREE);
  assert.equal(placeOf(root), "");
  assert.equal(placeOf(odom), "1.00 −2.00 0.00 m · 90°");
  assert.equal(placeOf(laser), "0.00 0.00 0.20 m · 0°");
});

test("values that are no tree have no frames", () => {
  for (const value of [null, undefined, 5, "x", [], {}, { frames: "x" }]) assert.deepEqual(framesOf(value), []);
});

test("rows that lie do not reach the page as numbers", () => {
  const [row, empty] = framesOf({ frames: [{ name: 5, parent: {}, depth: 1e9, translation: [1, "2", 3], rotation: [0, 0, 0], age: "x" }, null] });
  assert.deepEqual([row.name, row.parent, row.depth, row.age], ["", "", 12, null]);
  assert.equal(placeOf(row), "");
  assert.equal(empty.name, "");
});

test("at most 501 rows are drawn", () => {
  assert.equal(framesOf({ frames: Array.from({ length: 9000 }, () => ({})) }).length, 501);
});

test("the filter finds a frame and the frames below it", () => {
  const frames = framesOf(TREE);
  assert.deepEqual(filtered(frames, " ODOM ").map(({ name }) => name), ["odom", "laser"]);
  assert.equal(filtered(frames, "").length, 3);
});
