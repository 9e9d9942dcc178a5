// @ts-check
/** The worker that receives images: it joins parts, confirms what the server asks for, and connects again. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import vm from "node:vm";

const SCRIPT = readFileSync(new URL("../../urc/web/static/live/picture_worker.js", import.meta.url), "utf8");

class FakeSocket extends EventTarget {
  binaryType = "";
  isClosed = false;
  /** @type {string[]} */
  sent = [];
  /** @param {string} url */
  constructor(url) {
    super();
    this.url = url;
  }
  /** @param {string} text */
  send(text) {
    this.sent.push(text);
  }
  close() {
    this.isClosed = true;
  }
  /** @param {number[]} bytes */
  receives(...bytes) {
    this.dispatchEvent(Object.assign(new Event("message"), { data: Uint8Array.from(bytes).buffer }));
  }
}

function worker() {
  /** @type {FakeSocket[]} */
  const sockets = [];
  /** @type {any[]} */
  const posted = [];
  /** @type {{wait: number, run: () => void}[]} */
  const timers = [];
  const events = new EventTarget();
  class WebSocket extends FakeSocket {
    /** @param {string} url */
    constructor(url) {
      super(url);
      sockets.push(this);
    }
  }
  const scope = {
    WebSocket,
    performance,
    ArrayBuffer,
    Uint8Array,
    postMessage: (/** @type {any} */ message) => posted.push([...new Uint8Array(message.data)]),
    addEventListener: events.addEventListener.bind(events),
    setTimeout: (/** @type {() => void} */ run, /** @type {number} */ wait) => timers.push({ wait, run }),
    clearTimeout: () => {},
  };
  vm.runInNewContext(SCRIPT, scope);
  const say = (/** @type {any} */ data) => events.dispatchEvent(Object.assign(new Event("message"), { data }));
  return { sockets, posted, timers, say };
}

const JOIN = { url: "ws://urc/ws/pictures", key: "k" };

test("the socket joins its page, and parts become messages", () => {
  const { sockets, posted, say } = worker();
  say(JOIN);
  const [socket] = sockets;
  assert.ok(socket);
  assert.equal(socket.url, JOIN.url);
  socket.dispatchEvent(new Event("open"));
  assert.deepEqual(socket.sent, ['{"t":"pictures","key":"k"}']);
  socket.receives(1, 10, 11);
  socket.receives(0, 20);
  socket.receives(0, 21);
  socket.receives(1, 22);
  assert.deepEqual(posted, [[10, 11], [20, 21, 22]]);
});

test("the number of received bytes is confirmed where the server asks for it", () => {
  const { sockets, say } = worker();
  say(JOIN);
  const [socket] = sockets;
  socket?.receives(0, 1, 2);
  socket?.receives(2, 3);
  socket?.receives(3, 4);
  assert.deepEqual(socket?.sent, ["5", "7"]);
});

test("a lost socket is opened again, later and later, and begins with a new message", () => {
  const { sockets, posted, timers, say } = worker();
  say(JOIN);
  sockets[0]?.receives(0, 1);
  sockets[0]?.dispatchEvent(new Event("close"));
  timers[0]?.run();
  sockets[1]?.dispatchEvent(new Event("close"));
  assert.deepEqual(timers.map(({ wait }) => wait), [250, 500]);
  timers[1]?.run();
  sockets[2]?.receives(3, 9);
  assert.deepEqual(posted, [[9]]);
  assert.deepEqual(sockets[2]?.sent, ["2"], "bytes count for each socket");
});

test("without a page nothing is open", () => {
  const { sockets, posted, timers, say } = worker();
  say(JOIN);
  say(null);
  assert.ok(sockets[0]?.isClosed);
  sockets[0]?.receives(1, 5);
  sockets[0]?.dispatchEvent(new Event("close"));
  assert.deepEqual([posted, timers, sockets.length], [[], [], 1]);
});
