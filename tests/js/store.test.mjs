// What the page knows of its signals when the server says anew what there is, and what it can know of limits.
import assert from "node:assert/strict";
import { test } from "node:test";

import { noteOf } from "../../urc/web/static/widgets/kit.js";
import { watched } from "../../urc/web/static/live/page_topics.js";
import { Store } from "../../urc/web/static/live/store.js";

/** @param {Store} store @param {...object} signals */
function hello(store, ...signals) {
  const declared = signals.map((signal) => ({ type: "number", ...signal }));
  store.hello(/** @type {any} */ ({ robot: "", title: "", now: 0, signals: declared }), 0);
}

/** @param {...object} signals */
function storeOf(...signals) {
  const store = new Store();
  hello(store, ...signals);
  store.setUp(true, 0);
  return store;
}

test("a value whose signal is no more is forgotten, the others stay", () => {
  const store = storeOf({ name: "speed" }, { name: "volts" });
  store.values({ n: 0, i: [0, 1], v: [9, 12], a: 0, s: ["hihi", "low"] }, 0);
  hello(store, { name: "volts" }, { name: "velocity" });
  assert.deepEqual([...store.samples.keys()], ["volts"]);
  assert.deepEqual([store.reading("volts", 0).value, store.look("speed", 0)], [12, 0]);
});

test("of what has an alarm it is counted what is known", () => {
  const has_alarms = true;
  const store = storeOf({ name: "speed", has_alarms, stale_after_s: 3 }, { name: "heat", has_alarms }, { name: "name" });
  assert.deepEqual(watched(store, 0).value, { limited: 2, known: 0 });
  store.values({ n: 0, i: [0, 2], v: [9, 1], a: 0, s: ["high", ""] }, 0);
  assert.deepEqual(watched(store, 0).value, { limited: 2, known: 1 });
  assert.deepEqual(watched(store, 7000).value, { limited: 2, known: 0 });
  store.values({ n: 7000, i: [0, 1], v: [1, 1], a: 0 }, 7000);
  assert.deepEqual(watched(store, 7000).value, { limited: 2, known: 2 });
  store.setUp(false, 7000);
  assert.deepEqual(watched(store, 7001).value, { limited: 2, known: 0 });
});

test("an alarm has the shape of its declared priority", () => {
  const charge = { name: "charge", priorities: { lolo: "medium", low: "low" } };
  const mode = { name: "mode", type: "string", priorities: { REDUCED: "low", FAULT: "high", SAFEGUARD: "medium" } };
  const store = storeOf(charge, mode, { name: "heat" });
  const note = (/** @type {string} */ name) => noteOf(store.reading(name, 0), (text) => text);
  const say = (/** @type {any} */ v, /** @type {string[]} */ s) => store.values({ n: 0, i: [0, 1, 2], v, a: 0, s: /** @type {any} */ (s) }, 0);
  say([15, "REDUCED", 90], ["low", "minor", "high"]);
  assert.deepEqual(["charge", "mode", "heat"].map(note), ["◇ Low", "◇ Warning", "◆ High"]);
  say([5, "FAULT", 99], ["lolo", "major", "hihi"]);
  assert.deepEqual(["charge", "mode", "heat"].map(note), ["◆ Very low", "▲ Alarm", "▲ Very high"]);
  say([50, "SAFEGUARD", 20], ["", "minor", ""]);
  assert.deepEqual(["charge", "mode", "heat"].map(note), ["", "◆ Warning", ""]);
  say([50, "NORMAL", 20], ["", "minor", ""]);
  assert.equal(note("mode"), "◆ Warning"); // the alarm state has ended, and the off-delay has not
});
