// @ts-check
/** The card and the badge of a lost robot: when they are shown, and their words. */
import assert from "node:assert/strict";
import { test } from "node:test";

import { install } from "./dom.mjs";
import { Badge } from "../../urc/web/static/live/badge.js";
import { causeWords, placeOf } from "../../urc/web/static/core/connection_causes.js";
import { emptyWords, lastWords, lossOf, lowestGap, triesWords, waitsIn, wordsOf } from "../../urc/web/static/live/lost_card.js";
import { Store } from "../../urc/web/static/live/store.js";

/** @returns {any} a socket that is up */
function socket(more = {}) {
  return { failures: 0, isShutOut: false, refusal: "", ...more };
}

/** @param {Record<string, string>} states state of each transport */
function robot(states) {
  const store = new Store();
  store.setUp(true, 0);
  const rows = Object.entries(states).map(([transport, state]) => ({
    transport, state, address: `ros 127.0.0.1:9 ${transport}`, since: 0, detail: "x", attempts: 1, faults: 0, cause: "refused",
  }));
  store.setLinks(/** @type {any} */ (rows), 0);
  return store;
}

test("a robot is lost if no connection is good and one is lost", () => {
  assert.equal(lossOf(robot({}), socket()), null);
  assert.equal(lossOf(robot({ wire: "connecting" }), socket()), null);
  assert.equal(lossOf(robot({ wire: "live", eye: "lost" }), socket()), null);
  assert.equal(lossOf(robot({ wire: "silent", eye: "lost" }), socket()), null);
  const loss = lossOf(robot({ wire: "idle", eye: "lost" }), socket());
  assert.equal(loss?.of, "robot");
  assert.deepEqual(loss, { of: "robot", transport: "eye", cause: "refused", address: "ros 127.0.0.1:9 eye", detail: "x" });
});

test("the card says how old the background behind it is", () => {
  const ground = (/** @type {Record<string, string>} */ given) => /** @type {any} */ ({
    getAttribute: (/** @type {string} */ name) => given[name] ?? null,
    hasAttribute: (/** @type {string} */ name) => name in given,
  });
  assert.equal(lastWords(ground({ "data-old-age": "12 s", "data-picture": "" })), "Last picture: 12 s ago");
  assert.equal(lastWords(ground({ "data-old-age": "12 s" })), "Last values: 12 s ago");
  assert.equal(lastWords(ground({ "data-picture": "" })), "", "nothing was received");
  assert.equal(lastWords(null), "");
  assert.equal(emptyWords(ground({ "data-picture": "" })), "No picture: not connected");
  assert.equal(emptyWords(ground({ "data-old-age": "12 s", "data-picture": "" })), "");
  assert.equal(emptyWords(ground({})), "", "a map, for example");
});

test("a page waits for the server, and for a connection that is not open yet", () => {
  assert.equal(waitsIn(new Store(), []), true);
  assert.equal(waitsIn(robot({ wire: "connecting" }), []), true);
  assert.equal(waitsIn(robot({ wire: "connecting" }), ["wire"]), false, "only commands open it");
  assert.equal(waitsIn(robot({ wire: "live" }), []), false);
  const quiet = robot({ wire: "connecting" });
  const wire = quiet.links.get("wire");
  assert.ok(wire);
  wire.ready = true;
  assert.equal(waitsIn(quiet, []), false, "a robot may wait to be asked");
});

test("without the server the card speaks of the server, after the first failure", () => {
  const store = new Store();
  assert.equal(lossOf(store, socket()), null);
  assert.deepEqual(lossOf(store, socket({ failures: 1 })), { of: "server", detail: "" });
  assert.equal(lossOf(store, socket({ failures: 1, isShutOut: true })), null);
});

test("a reason of the server is no lost connection to it", () => {
  const reason = "too many clients watch this robot";
  const loss = lossOf(new Store(), socket({ failures: 1, refusal: reason }));
  assert.deepEqual(loss, { of: "session", detail: reason });
  assert.ok(loss);
  assert.equal(wordsOf(loss, "Cart").heading, "Cannot open Cart");
  assert.equal(wordsOf(loss, "Cart").cause, reason);
  assert.equal(wordsOf(loss, "Cart").step, "Check the settings of the robot.");
});

test("a package that is not installed is no mistake in the settings", () => {
  const detail = "mqtt needs the package paho-mqtt: python3 -m pip install 'paho-mqtt<3,>=2.1'";
  const { cause, step } = wordsOf({ of: "session", detail }, "Rover");
  assert.equal(cause, detail);
  assert.equal(step, "Install it, then start URC again.");
  assert.equal(causeWords("", "ros 127.0.0.1:9", detail).step, "Install it, then start URC again.");
});

/** @returns {[string, string | undefined]} text and sign of the badge */
function badgeOf(/** @type {Store} */ store, /** @type {any} */ line) {
  install();
  const el = document.createElement("div");
  for (const name of ["data-badge-text", "data-badge-trip"]) el.append(document.createElement("span"));
  [...el.children].forEach((one, place) => one.setAttribute(place ? "data-badge-trip" : "data-badge-text", ""));
  new Badge(el).frame(store, { tripMs: null, ...line });
  return [el.children[0]?.textContent ?? "", el.dataset["state"]];
}

test("the badge tells a robot that cannot be opened from a server that is gone", () => {
  assert.deepEqual(badgeOf(new Store(), socket()), ["Connecting", "connecting"]);
  assert.deepEqual(badgeOf(new Store(), socket({ failures: 1 })), ["No connection to URC", "bad"]);
  assert.deepEqual(badgeOf(new Store(), socket({ failures: 1, refusal: "x" })), ["Cannot open", "bad"]);
});

test("only a robot that was connected is lost", () => {
  const store = robot({ wire: "lost" });
  assert.deepEqual(badgeOf(store, socket()), ["Not connected", "bad"]);
  store.setLinks([...store.links.values()].map((link) => ({ ...link, state: "live" })), 0);
  assert.deepEqual(badgeOf(store, socket()), ["Live", "good"]);
  store.setLinks([...store.links.values()].map((link) => ({ ...link, state: "lost" })), 0);
  assert.deepEqual(badgeOf(store, socket()), ["Robot lost", "bad"]);
});

test("a refusal names the program that the transport needs", () => {
  assert.deepEqual(causeWords("refused", "ros 127.0.0.1:9", "x"), {
    cause: "127.0.0.1:9 refuses the connection.", step: "Is rosbridge running?", isForeign: false,
  });
  assert.equal(causeWords("refused", "tcp 10.0.0.5:23", "x").step, "Is the robot's program running?");
  assert.equal(causeWords("timeout", "ros 10.0.0.5:9", "x").cause, "10.0.0.5:9 does not answer.");
});

test("an unknown cause keeps the transport's own words", () => {
  const { cause, step, isForeign } = causeWords("", "tcp 10.0.0.5:23", "the moon is in the way");
  assert.equal(cause, "the moon is in the way");
  assert.ok(isForeign);
  assert.equal(step, "Check the settings of the robot.");
});

test("an address is shown without the type of its transport", () => {
  assert.equal(placeOf("serial /dev/ttyUSB0"), "/dev/ttyUSB0");
  assert.equal(placeOf("memory"), "memory");
});

test("the card counts the failed attempts and the time since the loss", () => {
  const store = robot({ wire: "lost" });
  const loss = lossOf(store, socket());
  assert.ok(loss);
  assert.equal(triesWords(loss, store, 0, 0), "1 failed attempt · URC keeps trying");
  assert.equal(triesWords(loss, store, 0, 7000), "1 failed attempt · for 7 s · URC keeps trying");
});

test("without the server it is the page that keeps trying", () => {
  const store = new Store();
  assert.equal(triesWords({ of: "server", detail: "" }, store, 0, 65_000), "for 1 min · This page keeps trying");
});

test("the card is in the lowest place that is high enough between what stays in sight", () => {
  const picture = { top: 48, bottom: 348 };
  const value = { top: 284, bottom: 342 };
  const view = { top: 602, bottom: 692 };
  assert.equal(lowestGap([view, picture, value], 48, 692, 200), 594, "above the view");
  assert.equal(lowestGap([view, picture, value], 48, 760, 60), 760, "below the view");
  assert.equal(lowestGap([picture, value], 48, 692, 336), 692);
  assert.equal(lowestGap([picture, value], 48, 692, 337), null, "too high for the place");
  assert.equal(lowestGap([], 48, 692, 644), 692);
  assert.equal(lowestGap([{ top: 0, bottom: 900 }], 48, 692, 1), null, "nothing is free");
  assert.equal(lowestGap([picture, { top: 400, bottom: 400 }], 48, 692, 300), 692, "an empty box");
});
