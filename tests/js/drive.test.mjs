// @ts-check
/** Which ticks go out: none behind others that wait, and none is kept back by one on its way. */
import assert from "node:assert/strict";
import test from "node:test";
import { Drive } from "../../urc/web/static/drive.js";

Object.assign(globalThis, { WebSocket: { OPEN: 1 } });
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
