// @ts-check
/** The page's WebSocket, over one of the test's own and a clock that the test moves. */
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";

/** @type {FakeLine[]} */
let lines = [];
/** What the page's interval calls. @type {() => void} */
let tick = () => {};
let nowMs = 0;

class FakeLine extends EventTarget {
  static OPEN = 1;

  constructor() {
    super();
    this.readyState = 1;
    this.bufferedAmount = 0;
    /** @type {string[]} */
    this.sent = [];
    lines.push(this);
  }

  /** @param {string} text */
  send(text) {
    this.sent.push(text);
  }

  close() {
    this.readyState = 3;
  }

  /** @param {object} message */
  says(message) {
    this.dispatchEvent(new MessageEvent("message", { data: JSON.stringify(message) }));
  }
}

Object.assign(globalThis, {
  WebSocket: FakeLine,
  window: {
    setInterval: (/** @type {() => void} */ act) => ((tick = act), 1),
    setTimeout: () => 1,
  },
});
performance.now = () => nowMs;

const { Socket } = await import("../../urc/web/static/live/socket.js");

/** Let so much time pass for a page that runs: each of its ticks comes when it is due. */
function passes(/** @type {number} */ seconds) {
  for (let second = 0; second < seconds; second += 1) {
    nowMs += 1001;
    tick();
  }
}

/** Open a connection. */
function opened() {
  const states = /** @type {boolean[]} */ ([]);
  const socket = new Socket("ws://here/ws", {
    message() {},
    trip() {},
    state: (isUp) => states.push(isUp),
  });
  socket.open();
  return { socket, states, line: /** @type {FakeLine} */ (lines.at(-1)) };
}

beforeEach(() => {
  lines = [];
  nowMs = 1000;
});

test("a line whose ping is not answered for three seconds is given up", () => {
  const { socket, line } = opened();
  line.says({ t: "hello" });
  passes(1);
  assert.match(line.sent[0] ?? "", /"ping"/);
  passes(2);
  assert.ok(socket.isUp);
  passes(2);
  assert.ok(!socket.isUp);
  assert.equal(socket.reason, "no answer");
  assert.equal(socket.refusal, "", "a silent server refuses nothing");
});

test("the refusal is the full text of the server, for one attempt", () => {
  const { socket, line } = opened();
  line.says({ t: "error", code: "refused", message: "mqtt needs the package paho-mqtt: …" });
  line.dispatchEvent(Object.assign(new Event("close"), { code: 4500, reason: "mqtt needs" }));
  assert.equal(socket.refusal, "mqtt needs the package paho-mqtt: …");
  socket.connect();
  lines.at(-1)?.dispatchEvent(Object.assign(new Event("close"), { code: 1006, reason: "" }));
  assert.equal(socket.refusal, "");
});

test("a browser that must sign in is not refused the robot", () => {
  const { socket, line } = opened();
  line.dispatchEvent(Object.assign(new Event("close"), { code: 4401, reason: "sign in" }));
  assert.equal(socket.refusal, "");
});

test("an opening that hangs is given up, too", () => {
  const { socket } = opened();
  passes(4);
  assert.equal(socket.line, null);
});

test("pongs that come keep it", () => {
  const { socket, line } = opened();
  line.says({ t: "hello" });
  for (let round = 0; round < 10; round += 1) {
    passes(1);
    line.says({ t: "pong", c: nowMs - 20, u: 0 });
  }
  assert.ok(socket.isUp);
  assert.equal(socket.tripMs, 20);
});

test("a page that was held up reads what has come before it gives anything up", () => {
  const { socket, states, line } = opened();
  nowMs += 20_000; // its modules took so long; the hello waits behind the tick
  tick();
  line.says({ t: "hello" });
  assert.ok(socket.isUp);
  passes(1);
  nowMs += 20_000; // and so does a pong
  tick();
  line.says({ t: "pong", c: 0, u: 0 });
  passes(1);
  assert.ok(socket.isUp);
  assert.deepEqual(states, [true]);
  assert.equal(lines.length, 1);
});
