// How many widgets are drawn in a frame, and what is told to screen readers.
import assert from "node:assert/strict";
import { test } from "node:test";

import { tell } from "../../urc/web/static/kit.js";
import { FEW, LONGEST_TURN, Pace, SHARE_MS } from "../../urc/web/static/pace.js";

const COUNT = 60;

/**
 * Let frames pass on a device.
 *
 * @param {Pace} pace
 * @param {(drawn: number) => number} cost milliseconds of a frame that draws so many
 * @param {number} [frames]
 */
function play(pace, cost, frames = 200) {
  let drawn = 0;
  for (let frame = 0; frame < frames; frame += 1) {
    drawn = Math.min(COUNT, pace.allowed(COUNT));
    pace.learn(drawn, cost(drawn), COUNT);
  }
  return drawn;
}

test("a device that is fast enough draws everything in each frame", () => {
  assert.equal(play(new Pace(), (drawn) => drawn * 0.1), COUNT);
});

test("a slower one draws as many widgets as fit into their share of a frame", () => {
  const drawn = play(new Pace(), (each) => 2 + each * 0.3);
  assert.ok(drawn >= 15 && drawn <= 21, `${drawn} widgets, ${2 + drawn * 0.3} of ${SHARE_MS} ms`);
});

test("on the slowest one each widget still has its turn", () => {
  assert.equal(play(new Pace(), () => 300), COUNT / LONGEST_TURN);
});

test("what was a moment's hindrance is forgotten within a second", () => {
  const pace = new Pace();
  play(pace, () => 300, 20);
  assert.equal(play(pace, (drawn) => drawn * 0.05, 60), COUNT);
});

test("a page whose turns are as short as can be still finds out that there is room", () => {
  const pace = new Pace();
  play(pace, () => 300, 20);
  const drawn = pace.allowed(COUNT);
  assert.ok(drawn < FEW, `${drawn} widgets have their turn`);
  assert.ok(pace.isTelling(drawn, COUNT - drawn));
});

test("a frame of few widgets, or of none, tells nothing", () => {
  const pace = new Pace();
  assert.equal(pace.isTelling(FEW - 1, 0), false);
  assert.equal(pace.isTelling(0, COUNT), false);
});

test("fewer widgets than frames of a turn are one each", () => {
  const pace = new Pace();
  pace.learn(2, 300, 2);
  assert.equal(pace.allowed(2), 1);
});

test("screen readers are told at once, and then the newest after a while", async () => {
  /** @type {Map<string, string>} */
  const written = new Map();
  let writes = 0;
  const meter = /** @type {any} */ ({
    getAttribute: (/** @type {string} */ name) => written.get(name) ?? null,
    setAttribute: (/** @type {string} */ name, /** @type {string} */ value) => {
      writes += 1;
      written.set(name, value);
    },
  });
  for (let value = 1; value <= 100; value += 1) tell(meter, { "aria-valuenow": String(value) });
  assert.deepEqual([writes, written.get("aria-valuenow")], [1, "1"]);
  const untilMs = performance.now() + 10_000;
  while (written.get("aria-valuenow") !== "100" && performance.now() < untilMs) {
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
  assert.deepEqual([writes, written.get("aria-valuenow")], [2, "100"]);
});
