// Access units go to the worker and images come back: with the age of their unit, and never without one.
import assert from "node:assert/strict";
import { test } from "node:test";

globalThis.isSecureContext = true;
globalThis.VideoDecoder = /** @type {any} */ (class {});
const { frameOf } = await import("../../urc/web/static/live/frames.js");
const { Store } = await import("../../urc/web/static/live/store.js");
const { Videos } = await import("../../urc/web/static/live/videos.js");

const LOW = 2 ** 31;

class FakeWorker extends EventTarget {
  constructor() {
    super();
    /** @type {any[]} */
    this.posted = [];
  }
  /** @param {any} message */
  postMessage(message) {
    this.posted.push(message);
  }
  terminate() {}
  /** @param {any} data */
  says(data) {
    this.dispatchEvent(Object.assign(new Event("message"), { data }));
  }
}

class Bitmap {
  width = 4;
  height = 3;
  isClosed = false;
  close() {
    this.isClosed = true;
  }
}

/** Return a message as the server encodes it. */
function unit({ number = 7, ageMs = 40, sentMs = 1000, isKey = true, isSparse = false, codec = "avc1.42E01E", index = 0, data = [1, 2] }) {
  const message = new DataView(new ArrayBuffer(25 + codec.length + data.length));
  message.setUint8(0, 2);
  message.setUint8(1, codec.length);
  message.setUint16(2, index);
  message.setUint32(4, ageMs);
  message.setFloat64(8, sentMs);
  message.setUint32(16, number);
  message.setUint16(20, 640);
  message.setUint16(22, 480);
  message.setUint8(24, (isKey ? 1 : 0) + (isSparse ? 4 : 0));
  [...codec].forEach((letter, place) => message.setUint8(25 + place, letter.charCodeAt(0)));
  data.forEach((byte, place) => message.setUint8(25 + codec.length + place, byte));
  const frame = frameOf(message.buffer);
  assert.ok(frame);
  return frame;
}

function page() {
  const store = new Store();
  const signals = [
    { name: "eye", type: "video", stale_after_s: 2 },
    { name: "cam", type: "image" },
  ];
  store.hello(/** @type {any} */ ({ robot: "", title: "", now: 0, signals }), 0);
  store.setUp(true, 0);
  const worker = new FakeWorker();
  const told = { changed: 0, refused: 0 };
  const videos = new Videos(store, () => (told.changed += 1), () => (told.refused += 1), () => /** @type {any} */ (worker));
  return { store, worker, told, videos };
}

test("an access unit is read as the server wrote it", () => {
  const { type, video, number, bytes, ageMs } = unit({ number: 70000, ageMs: 1234, isKey: false });
  assert.deepEqual([type, ageMs, [...bytes]], ["avc1.42E01E", 1234, [1, 2]]);
  assert.equal(number, 70000);
  assert.deepEqual(video, { width: 640, height: 480, isKey: false, isSparse: false });
  assert.equal(frameOf(new ArrayBuffer(20)), null);
});

test("a reading changes only when an image is decoded, and has the age of its unit", () => {
  const { store, worker, told, videos } = page();
  videos.take(unit({ number: 7, ageMs: 40, sentMs: 1000 }), 1000);
  assert.equal(store.reading("eye", 1000).state, "none");
  worker.says({ signal: "eye", number: 7, bitmap: new Bitmap() });
  assert.equal(told.changed, 1);
  assert.equal(store.reading("eye", 1100).time, 0.96);
  assert.equal(store.reading("eye", 1100).state, "live");
});

test("a decoder that stands still makes the reading stale although units arrive", () => {
  const { store, worker, videos } = page();
  videos.take(unit({ number: 1, ageMs: 0, sentMs: 0 }), 0);
  worker.says({ signal: "eye", number: 1, bitmap: new Bitmap() });
  for (let number = 2; number < 100; number += 1) {
    videos.take(unit({ number, isKey: false, ageMs: 0, sentMs: number * 33 }), number * 33);
  }
  assert.equal(store.reading("eye", 3300).state, "stale");
});

test("an image without a unit of this connection is not shown", () => {
  const { store, worker, videos } = page();
  videos.take(unit({ number: 1 }), 1000);
  const bitmap = new Bitmap();
  worker.says({ signal: "eye", number: 2, bitmap });
  assert.ok(bitmap.isClosed);
  assert.equal(store.reading("eye", 1000).state, "none");
});

test("images that a camera with B-frames sends in another order are all shown", () => {
  const { store, worker, told, videos } = page();
  for (const number of [1, 2, 3, 4]) videos.take(unit({ number, sentMs: 33 * number, ageMs: 0 }), 33 * number);
  for (const number of [1, 3, 2, 4]) worker.says({ signal: "eye", number, bitmap: new Bitmap() });
  assert.equal(told.changed, 4);
  assert.equal(store.reading("eye", 140).time, 0.132);
});

test("what the decoder leaves out takes no memory", () => {
  const { worker, videos } = page();
  for (let number = 1; number <= 500; number += 1) {
    videos.take(unit({ number }), 1000);
    if (number % 10 === 0) worker.says({ signal: "eye", number, bitmap: new Bitmap() });
  }
  assert.ok((videos.times.get("eye")?.size ?? 0) < 30);
});

test("the earlier image is closed", () => {
  const { worker, videos } = page();
  const [first, second] = [new Bitmap(), new Bitmap()];
  videos.take(unit({ number: 1 }), 1000);
  videos.take(unit({ number: 2, isKey: false }), 1000);
  worker.says({ signal: "eye", number: 1, bitmap: first });
  worker.says({ signal: "eye", number: 2, bitmap: second });
  assert.deepEqual([first.isClosed, second.isClosed], [true, false]);
});

test("a codec that the browser lacks is requested as JPEG, once", () => {
  const { worker, told, videos } = page();
  videos.take(unit({ codec: "hev1.1.6.L93.B0" }), 1000);
  assert.deepEqual(videos.undecoded(["eye", "cam"]), []);
  worker.says({ signal: "eye", fault: "hev1.1.6.L93.B0" });
  assert.equal(told.refused, 1);
  assert.deepEqual(videos.undecoded(["eye", "cam"]), ["eye"]);
  const count = worker.posted.length;
  videos.take(unit({}), 1000);
  assert.equal(worker.posted.length, count);
});

test("a damaged image costs one fault; three make the page request JPEG", () => {
  const { worker, told, videos } = page();
  for (let count = 1; count <= 3; count += 1) {
    videos.take(unit({ number: count }), 1000);
    assert.equal(told.refused, 0);
    worker.says({ signal: "eye", fault: "Decoding error." });
  }
  assert.equal(told.refused, 1);
});

test("faults far apart do not end the video", () => {
  const { worker, told, videos } = page();
  for (let number = 1; number <= 1000; number += 1) {
    videos.take(unit({ number, isKey: false }), 1000);
    if (number % 150 === 0) worker.says({ signal: "eye", fault: "Decoding error." });
    else worker.says({ signal: "eye", number, bitmap: new Bitmap() });
  }
  assert.equal(told.refused, 0);
});

test("without a secure context all videos are requested as JPEG", () => {
  const { videos } = page();
  videos.canDecode = false;
  assert.deepEqual(videos.undecoded(["eye", "cam"]), ["eye"]);
});

test("a video that is not shown ends in the worker", () => {
  const { store, worker, videos } = page();
  videos.take(unit({ number: 1 }), 1000);
  videos.keep(["cam"]);
  assert.deepEqual(worker.posted.at(-1), { signal: "eye", isOver: true });
  const bitmap = new Bitmap();
  worker.says({ signal: "eye", number: 1, bitmap });
  assert.ok(bitmap.isClosed);
  assert.equal(store.reading("eye", 1000).state, "none");
});

test("the page knows what a slow line leaves out", () => {
  const { store, worker, videos } = page();
  const quality = (/** @type {number} */ number, /** @type {any} */ more) => {
    videos.take(unit({ number, ...more }), 1000);
    worker.says({ signal: "eye", number, bitmap: new Bitmap() });
    return store.reading("eye", 1000).video?.quality;
  };
  assert.deepEqual(quality(7, {}), { isLow: false, isSparse: false, of: 0 });
  assert.deepEqual(quality(20, { isSparse: true }), { isLow: false, isSparse: true, of: 0 });
  assert.deepEqual(quality(50, { isSparse: true }), { isLow: false, isSparse: true, of: 30 });
  assert.deepEqual(quality(LOW + 5, { isSparse: true }), { isLow: true, isSparse: true, of: 0 });
  assert.deepEqual(quality(LOW + 6, { isKey: false }), { isLow: true, isSparse: false, of: 0 });
  assert.deepEqual(quality(51, {}), { isLow: false, isSparse: false, of: 0 });
  assert.equal(videos.times.get("eye")?.size, 0);
});
