// What was wished for, until the robot says the same or its time is over.
import assert from "node:assert/strict";
import { test } from "node:test";

import { PendingValue } from "../../urc/web/static/widgets/pending_value.js";

const WITHIN_MS = 3000;

globalThis.window = globalThis;

/** Make a wish whose clock the test moves. @param {import("node:test").TestContext} context */
function made(context) {
  context.mock.timers.enable({ apis: ["setTimeout"] });
  return new PendingValue({ withinMs: WITHIN_MS, show: () => undefined, signal: new AbortController().signal });
}

/** @param {number} serial @param {unknown} value */
const reading = (serial, value) => /** @type {any} */ ({ serial, value });

test("a wish that the robot fulfils already is none when its time is over", (context) => {
  const wish = made(context);
  wish.make(50, reading(1, 50));
  assert.equal(wish.isWaiting, true);
  context.mock.timers.tick(WITHIN_MS);
  assert.deepEqual([wish.value, wish.isMissed, wish.isWaiting], [null, false, false]);
});

test("what the robot said before does not answer a wish, and another value misses it", (context) => {
  const wish = made(context);
  wish.make(60, reading(1, 50));
  wish.take(reading(1, 60));
  assert.equal(wish.isWaiting, true);
  wish.take(reading(2, 55));
  context.mock.timers.tick(WITHIN_MS);
  assert.deepEqual([wish.value, wish.isMissed], [60, true]);
  wish.take(reading(3, 60));
  assert.deepEqual([wish.value, wish.isMissed], [null, false]);
});

test("a robot that says nothing any more fulfils no wish", (context) => {
  const wish = made(context);
  wish.make(50, reading(1, 50));
  wish.take(reading(1, null));
  context.mock.timers.tick(WITHIN_MS);
  assert.equal(wish.isMissed, true);
});
