// @ts-check
/** Which ticks go out: none behind others that wait, and none is kept back by one on its way. */
import assert from "node:assert/strict";
import test from "node:test";
import { Drive } from "../../urc/web/static/control/drive.js";

Object.assign(globalThis, { WebSocket: { OPEN: 1 }, window: globalThis });
let nowMs = 1000;
performance.now = () => nowMs;

/** A page that has the controls; its browser says that what was handed to it has not left it. */
function driving() {
  /** @type {string[]} */
  const sent = [];
  const socket = { unsent: 0, tripMs: 2, send: (/** @type {any} */ { say }) => sent.push(say) > 0 };
  const drive = new Drive(/** @type {any} */ (socket), "", () => {});
  const tell = (/** @type {string} */ say) => {
    if (!drive.isFree) return;
    drive.tell({ say }, true);
    socket.unsent += 100;
  };
  return { sent, socket, tell };
}

test("a tick may follow one that has hardly left the browser", () => {
  const { sent, tell } = driving();
  tell("one");
  nowMs += 3;
  tell("two");
  assert.deepEqual(sent, ["one", "two"]);
});

test("on a line that takes nothing no more than that waits", () => {
  const { sent, tell } = driving();
  for (let tick = 0; tick < 100; tick += 1) {
    tell(String(tick));
    nowMs += 4;
  }
  assert.deepEqual(sent, ["0", "1"]);
});

test("as soon as the line is free, the newest goes", () => {
  const { sent, socket, tell } = driving();
  tell("one");
  nowMs += 50;
  tell("late");
  socket.unsent = 0;
  tell("newest");
  assert.deepEqual(sent, ["one", "newest"]);
});

test("STOP that nobody could be told is told as soon as URC is back", async () => {
  /** @type {string[]} */
  const sent = [];
  let isUp = false;
  const socket = { unsent: 0, tripMs: 2, send: (/** @type {any} */ { t }) => isUp && sent.push(t) > 0 };
  const drive = new Drive(/** @type {any} */ (socket), "http://127.0.0.1:1/stop", () => {});
  globalThis.fetch = () => Promise.reject(new Error("there is nobody"));
  const lease = { you: "s1", epoch: 3, holder: null, asker: null, latched: "", confirmed: false, drives: true, left: 0, stops: 0 };
  drive.stop();
  await new Promise(setImmediate);
  assert.equal(drive.phase, "failed");
  isUp = true;
  drive.setLease(/** @type {any} */ (lease), nowMs);
  assert.deepEqual([sent, drive.phase], [["stop"], "sent"]);
  drive.setLease(/** @type {any} */ ({ ...lease, epoch: 4, latched: "screen 1", stops: 1 }), nowMs);
  assert.deepEqual([sent, drive.phase, drive.isLatched], [["stop"], "", true]);
});

test("a stop is told by how often it was pressed, also when it was reset before the page heard of it", () => {
  const socket = { unsent: 0, tripMs: 2, send: () => true };
  const drive = new Drive(/** @type {any} */ (socket), "", () => {});
  const lease = { you: "s1", epoch: 3, stops: 4, holder: null, asker: null, latched: "", confirmed: false, drives: true, left: 0 };
  const set = (/** @type {object} */ news) => drive.setLease(/** @type {any} */ ({ ...lease, ...news }), nowMs);
  assert.equal(set({}), false, "what was before the page came is nothing to it");
  assert.equal(set({ epoch: 4 }), false, "the controls were taken");
  assert.equal(set({ epoch: 5, stops: 5, latched: "ann" }), true);
  assert.equal(set({ epoch: 6, stops: 5 }), false, "reset");
  assert.equal(set({ epoch: 9, stops: 6 }), true, "stopped and reset");
});

test("a latch from before the press is no answer to STOP", async () => {
  let posts = 0;
  globalThis.fetch = (url) => {
    posts += Number(url === "http://127.0.0.1:1/newer"); // timers of other tests may post, too
    return Promise.reject(new Error("the link is down"));
  };
  const socket = { unsent: 0, tripMs: 2, send: () => true };
  const drive = new Drive(/** @type {any} */ (socket), "http://127.0.0.1:1/newer", () => {});
  const lease = { you: "s1", epoch: 3, holder: null, asker: null, latched: "", confirmed: false, drives: true, left: 0, stops: 5 };
  drive.setLease(/** @type {any} */ (lease), nowMs);
  drive.stop();
  drive.setLease(/** @type {any} */ ({ ...lease, latched: "bob" }), nowMs); // sent before the press
  assert.equal(drive.phase, "sent");
  await new Promise((done) => setTimeout(done, 400));
  assert.equal(posts, 1);
  drive.setLease(/** @type {any} */ ({ ...lease, latched: "bob", stops: 6 }), nowMs);
  assert.equal(drive.phase, "");
});

test("a reset names the STOPs that its page knows", () => {
  /** @type {any[]} */
  const sent = [];
  const socket = { unsent: 0, tripMs: 2, send: (/** @type {any} */ message) => sent.push(message) > 0 };
  const drive = new Drive(/** @type {any} */ (socket), "", () => {});
  const lease = { you: "s1", epoch: 3, holder: null, asker: null, latched: "bob", confirmed: true, drives: true, left: 0, stops: 5 };
  drive.setLease(/** @type {any} */ (lease), nowMs);
  drive.say("reset");
  drive.say("take");
  assert.deepEqual(sent, [{ t: "drive", verb: "reset", stops: 5 }, { t: "drive", verb: "take" }]);
});

test("the time of a latched STOP is known only to a page that was connected", () => {
  const socket = { unsent: 0, tripMs: 2, send: () => true };
  const drive = new Drive(/** @type {any} */ (socket), "", () => {});
  const lease = { you: "s1", epoch: 3, stops: 4, holder: null, asker: null, latched: "bob", confirmed: true, drives: true, left: 0 };
  const set = (/** @type {object} */ news) => drive.setLease(/** @type {any} */ ({ ...lease, ...news }), nowMs);
  set({});
  assert.equal(drive.latchedAtMs, null, "pressed before the page came");
  const pressedMs = Date.now();
  set({ stops: 5 });
  const atMs = drive.latchedAtMs ?? 0;
  assert.ok(atMs >= pressedMs && atMs <= Date.now());
  set({ stops: 5, epoch: 4 });
  assert.equal(drive.latchedAtMs, atMs, "the same STOP");
  drive.lost();
  set({ stops: 6 });
  assert.equal(drive.latchedAtMs, null, "pressed again while the page was away");
  set({ stops: 6, latched: "" });
  assert.equal(drive.latchedAtMs, null);
});
