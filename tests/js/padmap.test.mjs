import assert from "node:assert/strict";
import { test } from "node:test";
import {
  STANDARD, movedAxis, parsed, sticksOf, withAxis, withButton,
} from "../../urc/web/static/widgets/gamepad_map.js";

test("what was stored comes back the same", () => {
  const mine = withButton(withAxis(STANDARD, 1, 5, true), "left", 9);
  assert.deepEqual(parsed(JSON.stringify(mine)), mine);
  assert.deepEqual(mine.left, [9]);
  assert.deepEqual(STANDARD.axes, [0, 1, 2, 3], "the standard stays");
});

test("what is stored badly counts for nothing", () => {
  const bad = [
    null, "", "{", "null", "[]", "7", "{}",
    JSON.stringify({ ...STANDARD, axes: [0, 1, 2] }),
    JSON.stringify({ ...STANDARD, axes: [0, 1, 2, 1e9] }),
    JSON.stringify({ ...STANDARD, turned: [0, 0, 0, 0] }),
    JSON.stringify({ ...STANDARD, left: "4" }),
    JSON.stringify({ ...STANDARD, right: [-1] }),
    JSON.stringify({ ...STANDARD, slower: 1.5 }),
  ];
  for (const text of bad) assert.equal(parsed(text), null, String(text));
});

test("sticks are where the mapping says; what is not there rests", () => {
  assert.deepEqual(sticksOf(STANDARD, [0.1, 0.2, 0.3, 0.4]), [0.1, 0.2, 0.3, 0.4]);
  const mine = withAxis(withAxis(STANDARD, 0, 3, true), 2, -1, false);
  assert.deepEqual(sticksOf(mine, [0.1, 0.2, 0.3, 0.4]), [-0.4, 0.2, 0, 0.4]);
  assert.deepEqual(sticksOf(STANDARD, [NaN]), [0, 0, 0, 0]);
});

test("the axis that a person moves is found, a trigger that rests at its end is not", () => {
  assert.equal(movedAxis([0, -1, 0], [0.2, -1, -0.3]), null);
  assert.deepEqual(movedAxis([0, -1, 0], [0.2, -1, -0.9]), { place: 2, isNegative: true });
  assert.deepEqual(movedAxis([0, -1, 0], [0.6, 1, 0]), { place: 1, isNegative: false });
});
