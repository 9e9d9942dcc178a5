// @ts-check
import assert from "node:assert/strict";
import { test } from "node:test";
import { Recording, field, span } from "../../widgets/recorder/rows.js";

/** @typedef {import("../../urc/web/static/types.js").Reading} Reading */

/**
 * @param {string} name
 * @param {unknown} value
 * @param {number} serial
 * @param {number} time
 */
function reading(name, value, serial, time = 100) {
  return /** @type {Reading} */ (/** @type {unknown} */ ({ signal: { name }, value, serial, time }));
}

const DATE_MS = Date.UTC(2026, 0, 2, 3, 4, 5);

test("each reading is kept once, with the time at which it was measured", () => {
  const recording = new Recording(10);
  recording.skip([reading("a", 1, 1)]);
  assert.equal(recording.add([reading("a", 1, 1)], 100, DATE_MS), false, "it was there before");
  assert.equal(recording.add([reading("a", 2, 2, 99.5), reading("b", "on", 1)], 100, DATE_MS), true);
  assert.equal(recording.add([reading("a", 2, 2, 99.5), reading("b", "on", 1)], 101, DATE_MS + 1000), false);
  assert.equal(recording.add([reading("a", 2, 3, 101)], 101, DATE_MS + 1000), true, "an equal value is news, too");
  assert.equal(
    recording.table(),
    "time,signal,value\r\n" +
      "2026-01-02T03:04:04.500Z,a,2\r\n2026-01-02T03:04:05.000Z,b,on\r\n2026-01-02T03:04:06.000Z,a,2\r\n",
  );
});

test("what is not known is no row, and what comes too late stands where it belongs", () => {
  const recording = new Recording(10);
  recording.add([reading("a", null, 1)], 100, DATE_MS);
  recording.add([reading("a", 1, 2, 100)], 100, DATE_MS);
  recording.add([reading("b", 2, 1, 99)], 101, DATE_MS + 1000);
  assert.deepEqual(recording.rows.map(([, name]) => name), ["a", "b"]);
  assert.match(recording.table(), /,b,2\r\n.*,a,1\r\n$/);
});

test("a full recording takes nothing more", () => {
  const recording = new Recording(2);
  for (let serial = 1; serial < 9; serial += 1) recording.add([reading("a", serial, serial)], 100, DATE_MS);
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
