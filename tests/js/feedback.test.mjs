// The feedback of a robot about a route that this page may not have sent.
import assert from "node:assert/strict";
import { test } from "node:test";

import { FRESH_S, Feedback } from "../../widgets/map/feedback.js";

/** @param {Partial<import("../../widgets/map/feedback.js").Told>} more */
const told = (more) => ({ value: 1, serial: 7, isLive: true, hasLimit: true, time: 100, ...more });

test("a live value tells of a route for as long as the driver declares", () => {
  const feedback = new Feedback();
  assert.equal(feedback.leftS(100), 0);
  feedback.take(told({}));
  assert.equal(feedback.leftS(1000), Infinity);
  feedback.take(told({ isLive: false }));
  assert.equal(feedback.leftS(100), 0);
});

test("without a declared limit, it tells of a route for a short time only", () => {
  const feedback = new Feedback();
  feedback.take(told({ hasLimit: false }));
  assert.equal(feedback.leftS(102), FRESH_S - 2);
  assert.equal(feedback.leftS(100 + FRESH_S), 0);
});

test("the last value of an ended route tells nothing, and a newer one does", () => {
  const feedback = new Feedback();
  feedback.take(told({}));
  feedback.end();
  assert.equal(feedback.leftS(100), 0);
  feedback.take(told({ serial: 8 }));
  assert.equal(feedback.leftS(100), Infinity);
});
