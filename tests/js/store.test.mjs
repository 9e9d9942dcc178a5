// What the page knows of its signals when the server says anew what there is, and what is past a limit.
import assert from "node:assert/strict";
import { test } from "node:test";

import { Alerts } from "../../urc/web/static/follow.js";
import { Store } from "../../urc/web/static/store.js";

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
