// @ts-check
/** The state of a robot in words, as its card on the menu shows it. */
import assert from "node:assert/strict";
import { test } from "node:test";

import { alarmWords, batteryWords, linkWords, whoWords } from "../../urc/web/static/manage/card_words.js";

const NOW_S = 1_000_000;

/**
 * @param {Partial<import("../../urc/web/static/manage/card_words.js").Summary>} [more]
 * @returns {import("../../urc/web/static/manage/card_words.js").Summary}
 */
function robot(more = {}) {
  return {
    name: "cart", state: "idle", connected: false, holder: "", latched: "", battery: null,
    alarms: { count: 0, worst: "" }, seen_at: null, ...more,
  };
}

test("without a page the card says when the robot was last seen", () => {
  const away = (/** @type {number} */ ageS) => linkWords(robot({ seen_at: NOW_S - ageS }), NOW_S).words;
  assert.equal(linkWords(robot(), NOW_S).words, "");
  assert.equal(away(5), "○ Last seen just now");
  assert.equal(away(-5), "○ Last seen just now"); // the clock went back
  assert.equal(away(600), "○ Last seen 10 min ago");
  assert.equal(away(47 * 3600), "○ Last seen 47 h ago");
  assert.equal(away(72 * 3600), "○ Last seen 3 days ago");
});

test("with a page the card shows the worst connection", () => {
  const of = (/** @type {any} */ state) => linkWords(robot({ connected: true, state }), NOW_S);
  assert.deepEqual(of("live"), { state: "live", words: "● Live", tone: "" });
  assert.deepEqual(of("lost"), { state: "lost", words: "▲ Not reached", tone: "bad" });
  assert.deepEqual(of("silent"), { state: "silent", words: "◆ Silent", tone: "caution" });
  assert.equal(of("idle").words, "◌ Connecting");
});

test("the battery has the tone of its limit", () => {
  const of = (/** @type {string} */ alarm) => batteryWords(robot({ battery: { value: 24, unit: "%", alarm } }));
  assert.equal(batteryWords(robot()), null);
  assert.deepEqual(of(""), { words: "Battery 24 %", tone: "" });
  assert.equal(of("low")?.tone, "caution");
  assert.equal(of("lolo")?.tone, "bad");
});

test("a latched stop matters more than the operator", () => {
  assert.equal(whoWords(robot()), null);
  assert.equal(whoWords(robot({ holder: "Tablet in the lab" }))?.words, "Tablet in the lab is driving");
  const both = whoWords(robot({ holder: "Ann", latched: "screen 3" }));
  assert.deepEqual(both, { words: "■ Stopped by screen 3", tone: "bad" });
});

test("alarms are counted, and the worst decides about the sign", () => {
  const of = (/** @type {number} */ count, /** @type {any} */ worst) => alarmWords(robot({ alarms: { count, worst } }));
  assert.equal(of(0, ""), null);
  assert.deepEqual(of(1, "low"), { words: "◇ 1 alarm", tone: "caution" });
  assert.deepEqual(of(2, "medium"), { words: "◆ 2 alarms", tone: "caution" });
  assert.deepEqual(of(3, "high"), { words: "▲ 3 alarms", tone: "bad" });
});
