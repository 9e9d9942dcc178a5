// The list of alarms as a page keeps it, its order and groups, and the sound that can be muted.
import assert from "node:assert/strict";
import { test } from "node:test";

import { AlarmBook, grouped, levelOf } from "../../urc/web/static/alarms/book.js";
import { conditionText, lineOf } from "../../urc/web/static/alarms/phrases.js";
import { alertOf } from "../../urc/web/static/alarms/page_alarms.js";
import { ALWAYS, AlarmSound } from "../../urc/web/static/alarms/sound.js";
import { Store } from "../../urc/web/static/live/store.js";

/** @param {string} signal @param {object} more */
function row(signal, more = {}) {
  return { signal, condition: "low", priority: "medium", state: "unacknowledged", number: 1, group: 1, raised: 1, began: 0, active: true, known: true, ...more };
}

/** @param {...object} rows @returns {any} */
function message(...rows) {
  return { t: "alarms", now: 5000, rows, full: true };
}

test("only changes come after the first message, and none is announced twice", () => {
  const book = new AlarmBook();
  assert.deepEqual(book.take(message(row("a"), row("b", { state: "acknowledged" })), 1000).map(({ signal }) => signal), ["a"]);
  assert.equal(book.leadMs, 4000);
  assert.deepEqual(book.take({ now: 5000, rows: [], gone: ["b"] }, 1000), []);
  assert.deepEqual([...book.rows.keys()], ["a"]);
  assert.deepEqual(book.take(message(row("a")), 1000), [], "a new connection sends everything again");
  assert.deepEqual(book.take({ now: 6000, rows: [row("a", { raised: 2 })] }, 1000).length, 1, "raised again");
  assert.deepEqual(book.take({ now: 6000, rows: [row("a", { raised: 3, state: "shelved" })] }, 1000), []);
  book.take(message(), 1000);
  assert.equal(book.rows.size, 0);
});

test("the most urgent alarm is first: active, not acknowledged, priority, then first-out", () => {
  const book = new AlarmBook();
  book.take(
    message(
      row("returned", { active: false, state: "returned", priority: "high", number: 1 }),
      row("seen", { state: "acknowledged", priority: "high", number: 2 }),
      row("second", { priority: "high", number: 4, condition: "lolo" }),
      row("mild", { priority: "high", number: 3, condition: "low" }),
      row("first", { priority: "high", number: 3, condition: "hihi" }),
      row("lesser", { priority: "low", number: 0 }),
      row("away", { state: "shelved" }),
      row("quiet", { state: "suppressed" }),
    ),
    0,
  );
  assert.deepEqual(book.listed().map(({ signal }) => signal), ["first", "second", "mild", "lesser", "seen", "returned"]);
  assert.deepEqual(book.hidden().map(({ signal }) => signal).sort(), ["away", "quiet"]);
  assert.deepEqual(book.count(), { active: 5, unacknowledged: 5, worst: "high" });
  assert.deepEqual(new AlarmBook().count(), { active: 0, unacknowledged: 0, worst: "" });
});

test("a flood is grouped by bursts, and every alarm is in one group", () => {
  const book = new AlarmBook();
  const rows = Array.from({ length: 200 }, (_, at) => row(`s${at}`, { number: at, group: at < 198 ? 7 : 8 }));
  book.take({ ...message(...rows), flood: true }, 0);
  const groups = grouped(book.listed(), book.isFlooded);
  assert.deepEqual(groups.map((group) => group.length), [198, 1, 1]);
  assert.equal(new Set(groups.flat().map(({ signal }) => signal)).size, 200);
  assert.equal(grouped(book.listed(), false).length, 200);
});

test("a state is an alarm or a warning, and its own words", () => {
  assert.equal(levelOf({ condition: "hihi", priority: "low" }), "hihi");
  assert.equal(levelOf({ condition: "protective stop", priority: "high" }), "major");
  assert.equal(levelOf({ condition: "reduced", priority: "medium" }), "minor");
  assert.deepEqual([conditionText("lolo"), conditionText("protective stop")], ["Very low", "protective stop"]);
  assert.equal(conditionText("PROTECTIVE_STOP"), "protective stop");
});

/** @param {object} signal */
function storeOf(signal) {
  const store = new Store();
  store.hello(/** @type {any} */ ({ robot: "", title: "", now: 0, signals: [{ name: "a", type: "number", title: "Battery", unit: "%", ...signal }] }), 0);
  store.setUp(true, 0);
  return store;
}

test("a line has the live value, its age, or the last one that the server knew", () => {
  const store = storeOf({ stale_after_s: 3 });
  const whole = /** @type {any} */ (row("a", { value: "9" }));
  assert.equal(lineOf(whole, store, 0), "Battery: Low, 9");
  store.values({ n: 0, i: [0], v: [8], a: 0, s: ["low"] }, 0);
  assert.equal(lineOf(whole, store, 0), "Battery: Low, 8 %");
  assert.equal(lineOf(whole, store, 7000), "Battery: Low, 8 % · 7 s old");
  store.setUp(false, 0);
  assert.equal(lineOf({ ...whole, known: false }, store, 700_000), "Battery: Low, 8 % · 11 min old");
  const empty = storeOf({ stale_after_s: 3 });
  assert.equal(lineOf({ ...whole, known: false }, empty, 0), "Battery: Low, value unknown");
  const state = { ...whole, condition: "protective stop", priority: "high" };
  assert.equal(lineOf(state, storeOf({ type: "string" }), 0), "Battery: protective stop");
});

test("widgets get each alarm with its end in seconds", () => {
  const whole = /** @type {any} */ (row("a", { value: "9", state: "shelved", shelved_by: "Ada", shelved_until: Date.now() + 4000 + 60_000 }));
  const found = alertOf(whole, storeOf({}), 0, 4000);
  assert.deepEqual([found.alarm, found.state, found.who, found.leftS], ["low", "shelved", "Ada", 60]);
});

test("a burst is one sound, a mute has an end, and the list does not depend on it", () => {
  /** @type {Record<string, string>} */
  const kept = {};
  const storage = { getItem: (/** @type {string} */ key) => kept[key] ?? null, setItem: (/** @type {string} */ key, /** @type {string} */ text) => void (kept[key] = text) };
  /** @type {boolean[]} */
  const played = [];
  const sound = new AlarmSound(storage, (isUrgent) => played.push(isUrgent));
  for (let ms = 0; ms < 10_000; ms += 50) sound.announce(false, true, ms);
  assert.equal(played.length, 1, "200 alarms in 10 s");
  sound.announce(true, false, 20_000);
  sound.announce(true, false, 21_000);
  assert.deepEqual(played, [false, true]);
  sound.mute(90_000);
  sound.announce(true, false, 80_000);
  assert.equal(new AlarmSound(storage, () => {}).isMuted(80_000), true, "over a reload");
  assert.equal(sound.isMuted(90_000), false);
  sound.announce(true, false, 95_000);
  assert.equal(played.length, 3);
  sound.mute(ALWAYS);
  assert.equal(sound.isMuted(Date.now() + 1e12), true);
});

test("a browser that refuses storage has a sound all the same", () => {
  const refuse = () => {
    throw new Error("refused");
  };
  /** @type {boolean[]} */
  const played = [];
  const sound = new AlarmSound({ getItem: refuse, setItem: refuse }, (isUrgent) => played.push(isUrgent));
  sound.mute(0);
  sound.announce(true, false, 0);
  assert.deepEqual(played, [true]);
});
