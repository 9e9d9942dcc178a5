// @ts-check
/** The page's socket for images: opened at its first use, and images have their time of arrival. */
import assert from "node:assert/strict";
import { test } from "node:test";

const { PictureLine } = await import("../../urc/web/static/live/picture_line.js");

class FakeWorker extends EventTarget {
  isOver = false;
  /** @type {any[]} */
  posted = [];
  /** @param {any} message */
  postMessage(message) {
    this.posted.push(message);
  }
  terminate() {
    this.isOver = true;
  }
  /** @param {any} data */
  says(data) {
    this.dispatchEvent(Object.assign(new Event("message"), { data }));
  }
}

function page() {
  const worker = new FakeWorker();
  /** @type {number[]} */
  const times = [];
  const line = new PictureLine("wss://urc/ws/pictures", (_, nowMs) => times.push(nowMs), () => /** @type {any} */ (worker));
  return { worker, times, line };
}

test("the socket is opened at its first use, and again for each connection of the page", () => {
  const { worker, line } = page();
  assert.equal(line.use(), false);
  line.join("one");
  assert.deepEqual(worker.posted, []);
  assert.ok(line.use());
  assert.ok(line.use());
  line.join("");
  assert.equal(line.use(), false);
  line.join("two");
  const url = "wss://urc/ws/pictures";
  assert.deepEqual(worker.posted, [{ url, key: "one" }, null, { url, key: "two" }]);
});

test("a message has the time at which the worker received it", () => {
  const { worker, times, line } = page();
  line.join("one");
  line.use();
  const nowMs = performance.now();
  worker.says({ data: new ArrayBuffer(1), timeMs: performance.timeOrigin + nowMs - 200 });
  worker.says({ data: new ArrayBuffer(1), timeMs: performance.timeOrigin + nowMs + 60_000 });
  worker.says({ data: new ArrayBuffer(1), timeMs: 0 });
  assert.ok(Math.abs((times[0] ?? 0) - (nowMs - 200)) < 1);
  assert.ok((times[1] ?? 0) >= nowMs && (times[2] ?? 0) >= nowMs, "clocks that disagree are not believed");
});

test("without a worker images stay on the main socket", () => {
  const { worker, line } = page();
  line.join("one");
  assert.ok(line.use());
  worker.dispatchEvent(new Event("error"));
  assert.ok(worker.isOver);
  assert.equal(line.use(), false);
  const none = new PictureLine("", () => {}, () => null);
  none.join("one");
  assert.equal(none.use(), false);
});
