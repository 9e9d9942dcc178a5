// How many widgets are drawn in a frame, and what is told to screen readers.
import assert from "node:assert/strict";
import { test } from "node:test";

import { tell } from "../../urc/web/static/widgets/kit.js";
import { FEW, LONGEST_TURN, DrawScheduler, SHARE_MS, SHARE_OF_TWO_MS } from "../../urc/web/static/widgets/draw_scheduler.js";

const COUNT = 60;

/**
 * Let frames pass on a device where all widgets always have something new; return how many each of
 * the last two drew.
 *
 * @param {DrawScheduler} pace
 * @param {(drawn: number) => number} cost milliseconds of a frame that draws so many
 * @param {number} [frames]
 */
function play(pace, cost, frames = 200) {
  const drawn = [];
  for (let frame = 0; frame < frames; frame += 1) {
    const now = Math.min(COUNT, pace.begin(COUNT));
    if (pace.end(now, COUNT - now)) pace.learn(now, cost(now), COUNT);
    drawn.push(now);
  }
  return drawn.slice(-2);
}

test("a device that is fast enough draws everything in each frame", () => {
  assert.deepEqual(play(new DrawScheduler(), (drawn) => drawn * 0.1), [COUNT, COUNT]);
});

test("a slower one draws as many widgets as fit into their share of a frame", () => {
  for (const drawn of play(new DrawScheduler(), (each) => 2 + each * 0.15)) {
    assert.ok(drawn >= 34 && drawn <= 41, `${drawn} widgets, ${2 + drawn * 0.15} of ${SHARE_MS} ms`);
  }
});

test("where there is no room for half of them, every second frame is free, and more are drawn", () => {
  const cost = (/** @type {number} */ each) => 5 + each * 0.3;
  const [one = 0, other = 0] = play(new DrawScheduler(), cost);
  const drawn = Math.max(one, other);
  assert.equal(Math.min(one, other), 0);
  assert.ok(drawn >= 20 && drawn <= 24, `${drawn} widgets, ${cost(drawn)} of ${SHARE_OF_TWO_MS} ms`);
  const inEach = (SHARE_MS - 5) / 0.3;
  assert.ok(drawn / 2 >= inEach, `${drawn} in two frames, ${inEach} in one`);
});

test("few widgets are drawn in each frame, whatever it was like with many", () => {
  const pace = new DrawScheduler();
  play(pace, () => 300);
  for (let frame = 0; frame < 10; frame += 1) {
    const room = pace.begin(COUNT);
    if (frame > 0) assert.ok(room > 0, `frame ${frame} has room for ${room}`);
    pace.end(Math.min(3, room), Math.max(0, 3 - room));
  }
});

test("on the slowest one each widget still has its turn", () => {
  assert.deepEqual(play(new DrawScheduler(), () => 300).sort(), [0, COUNT / LONGEST_TURN]);
});

test("after a free frame, or one in which nothing was new, widgets are drawn", () => {
  const pace = new DrawScheduler();
  play(pace, () => 300, 21); // the last one drew
  assert.equal(pace.begin(COUNT), 0);
  assert.ok(pace.begin(COUNT) > 0);
  assert.equal(pace.end(0, 0), false);
  assert.ok(pace.begin(COUNT) > 0);
});

test("what was a moment's hindrance is forgotten within a second", () => {
  const pace = new DrawScheduler();
  play(pace, () => 300, 20);
  assert.deepEqual(play(pace, (drawn) => drawn * 0.05, 60), [COUNT, COUNT]);
});

test("a page whose turns are as short as can be still finds out that there is room", () => {
  const pace = new DrawScheduler();
  play(pace, () => 300, 20);
  const drawn = pace.begin(COUNT);
  assert.ok(drawn < FEW, `${drawn} widgets have their turn`);
  assert.ok(pace.end(drawn, COUNT - drawn));
});

test("a frame of few widgets, or of none, tells nothing", () => {
  const pace = new DrawScheduler();
  assert.equal(pace.end(FEW - 1, 0), false);
  assert.equal(pace.end(0, COUNT), false);
});

test("fewer widgets than frames of a turn are one each", () => {
  const pace = new DrawScheduler();
  pace.learn(2, 300, 2);
  assert.equal(pace.begin(2), 1);
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
