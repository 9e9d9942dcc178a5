// What the page knows of its signals when the server says anew what there is, and what is past a limit.
import assert from "node:assert/strict";
import { test } from "node:test";

import { Alerts, watched } from "../../urc/web/static/live/page_topics.js";
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

test("a value whose signal is no more is forgotten with its alarm, the others stay", () => {
  const store = storeOf({ name: "speed" }, { name: "volts" });
  const alerts = new Alerts();
  store.values({ n: 0, i: [0, 1], v: [9, 12], a: 0, s: ["hihi", "low"] }, 0);
  assert.equal(alerts.news(store, 0).value.length, 2);
  hello(store, { name: "volts" }, { name: "velocity" });
  assert.deepEqual(alerts.news(store, 1000).value.map(({ signal, since }) => [signal, since]), [["volts", 0]]);
  assert.deepEqual([store.reading("volts", 0).value, store.look("speed", 0)], [12, 0]);
  hello(store, { name: "speed" });
  store.values({ n: 0, i: [0], v: [9], a: 0, s: ["hihi"] }, 2000);
  assert.deepEqual(alerts.news(store, 2000).value.map(({ since }) => since), [2], "it is past it anew");
});

test("an alert says how old its value is, and of what has a limit it is counted what is known", () => {
  const limits = { high: 5 };
  const store = storeOf({ name: "speed", limits, stale_after_s: 3 }, { name: "heat", limits }, { name: "name" });
  const alerts = new Alerts();
  assert.deepEqual(watched(store, 0).value, { limited: 2, known: 0 });
  store.values({ n: 0, i: [0, 2], v: [9, 1], a: 0, s: ["high", ""] }, 0);
  assert.deepEqual([watched(store, 0).value, alerts.news(store, 0).value[0]?.age], [{ limited: 2, known: 1 }, ""]);
  assert.deepEqual(watched(store, 7000).value, { limited: 2, known: 0 });
  assert.equal(alerts.news(store, 7000).value[0]?.age, "7 s");
  store.values({ n: 7000, i: [0, 1], v: [1, 1], a: 0 }, 7000);
  assert.deepEqual(watched(store, 7000).value, { limited: 2, known: 2 });
  store.setUp(false, 7000);
  assert.deepEqual(watched(store, 7001).value, { limited: 2, known: 0 });
});
