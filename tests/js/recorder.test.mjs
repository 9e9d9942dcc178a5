// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { Recording, field, span } from "../../widgets/recorder/rows.js";

/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */

/**
 * @param {string} name
 * @param {unknown} value
 * @param {number} time
 */
function reading(name, value, time = 100) {
  return /** @type {Reading} */ (/** @type {unknown} */ ({ signal: { name }, value, time }));
}

const DATE_MS = Date.UTC(2026, 0, 2, 3, 4, 5);

test("each reading is a row, with the time at which it was measured", () => {
  const recording = new Recording(10, 99.4);
  recording.add(reading("a", 1, 99.3), 0, 100, DATE_MS); // from before
  recording.add(reading("a", 2, 99.5), 0, 100, DATE_MS);
  recording.add(reading("b", "on"), 0, 100, DATE_MS);
  recording.add(reading("a", 2, 101), 0, 101, DATE_MS + 1000);
  assert.equal(
    recording.table(),
    "time,signal,value\r\n" +
      "2026-01-02T03:04:04.500Z,a,2\r\n2026-01-02T03:04:05.000Z,b,on\r\n2026-01-02T03:04:06.000Z,a,2\r\n",
  );
});

test("what is not known is no row, and what comes too late stands where it belongs", () => {
  const recording = new Recording(10, 0);
  recording.add(reading("a", null), 0, 100, DATE_MS);
  recording.add(reading("a", 1, 100), 0, 100, DATE_MS);
  recording.add(reading("b", 2, 99), 0, 101, DATE_MS + 1000);
  assert.deepEqual(recording.rows.map(([, name]) => name), ["a", "b"]);
  assert.match(recording.table(), /,b,2\r\n.*,a,1\r\n$/);
});

test("what was lost before a reading is counted, also where that one is not known", () => {
  const recording = new Recording(10, 50);
  recording.add(reading("a", 1, 49), 7, 100, DATE_MS);
  recording.add(reading("a", null), 2, 100, DATE_MS);
  recording.add(reading("a", 1), 3, 100, DATE_MS);
  assert.deepEqual([recording.lost, recording.rows.length], [5, 1]);
});

test("a full recording takes nothing more", () => {
  const recording = new Recording(2, 0);
  for (let value = 1; value < 9; value += 1) recording.add(reading("a", value), 0, 100, DATE_MS);
  assert.equal(recording.isFull, true);
  assert.deepEqual(recording.rows.map(([, , value]) => value), ["1", "2"]);
});

test("a robot's text is one field, and no formula", () => {
  assert.equal(field('a,"b"\r\nc'), '"a,""b""\r\nc"');
  assert.equal(field("=1+1"), "'=1+1");
  assert.equal(field("@x,y"), `"'@x,y"`);
  assert.deepEqual(["-1.5", "+2", "-1e-7", "12"].map(field), ["-1.5", "+2", "-1e-7", "12"]);
});

test("a time span reads like a clock", () => {
  assert.deepEqual([0, 5.9, 65, 3605, -1].map(span), ["0:00", "0:05", "1:05", "1:00:05", "0:00"]);
});
