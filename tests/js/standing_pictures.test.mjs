// @ts-check
/** Videos whose picture stands still: the rule, and its effect on ages and on what ticks report. */
import assert from "node:assert/strict";
import { test } from "node:test";

globalThis.isSecureContext = true;
globalThis.VideoDecoder = /** @type {any} */ (class {});
const { ShownImages } = await import("../../urc/web/static/control/shown_images.js");
const { StandingPictures } = await import("../../urc/web/static/live/standing_pictures.js");
const { Store } = await import("../../urc/web/static/live/store.js");
const { Videos } = await import("../../urc/web/static/live/videos.js");

const AFTER_MS = 1000;
const BLOCKS = 16;

/** Return a keyframe. @param {number} quality @param {number} timeMs @param {number} [fresh] number of its new blocks */
function keyframe(quality, timeMs, fresh = 0) {
  const blocks = Uint32Array.from({ length: BLOCKS }, (_, place) => (place < fresh ? 1e9 + timeMs * BLOCKS : 1000 * quality) + place);
  return { number: timeMs, timeMs, blocks };
}

/** Return the number of the first image after each keyframe. @param {[number, number, number?][]} keyframes */
function firsts(keyframes) {
  const standing = new StandingPictures();
  return keyframes.map(([quality, timeMs, fresh]) => {
    standing.add(keyframe(quality, timeMs, fresh));
    return standing.first(timeMs, AFTER_MS)?.number ?? null;
  });
}

test("a keyframe that repeats makes the picture as old as its first one, from the declared time on", () => {
  assert.deepEqual(firsts([[1, 0], [2, 500], [3, 1000], [2, 1400], [2, 1600], [1, 2000]]), [null, null, null, null, 500, 0]);
});

test("an eighth of the image may have a new quality, but areas without noise prove nothing", () => {
  assert.deepEqual(firsts([[1, 0], [1, 2000, BLOCKS / 8]]), [null, 0]);
  assert.deepEqual(firsts([[1, 0], [1, 2000, BLOCKS / 8 + 1], [1, 4000, BLOCKS / 4]]), [null, null, null]);
});

test("two new keyframes end the standstill; one may have a new quality", () => {
  assert.deepEqual(firsts([[1, 0], [1, 1000], [2, 2000], [1, 3000], [3, 4000], [4, 5000]]), [null, 0, 0, 0, 0, null]);
});

test("a standstill lasts longer than the memory, which is limited", () => {
  const standing = new StandingPictures();
  for (let time = 0; time < 400; time += 1) standing.add(keyframe(1, time * 1000));
  assert.equal(standing.first(400_000, AFTER_MS)?.number, 0);
  for (let time = 400; time < 800; time += 1) standing.add(keyframe(time, time * 1000));
  assert.equal(standing.blocks.size, 128 * BLOCKS);
  assert.equal(standing.keyframes.length, 128);
});

class FakeWorker extends EventTarget {
  /** @type {any[]} */
  posted = [];
  /** @param {any} message */
  postMessage(message) {
    this.posted.push(message);
  }
}

/** Return a page with one video; `film` shows an image of it. @param {number} frozenAfterS */
function page(frozenAfterS) {
  const store = new Store();
  const signals = [{ name: "eye", type: "video", stale_after_s: 60, frozen_after_s: frozenAfterS }];
  store.hello(/** @type {any} */ ({ robot: "", title: "", now: 0, signals }), 0);
  store.setUp(true, 0);
  const worker = new FakeWorker();
  const videos = new Videos(store, () => {}, () => {}, () => /** @type {any} */ (worker));
  const images = new ShownImages();
  /** @param {number} number @param {number} nowMs @param {number} [quality] quality of a keyframe */
  const film = (number, nowMs, quality) => {
    const video = { width: 4, height: 3, isKey: quality !== undefined };
    videos.take({ index: 0, ageMs: 0, sentMs: nowMs, number, type: "avc1.42E01E", bytes: new Uint8Array(2), video }, nowMs);
    const told = [{ signal: "eye", number, bitmap: { width: 4, height: 3, close() {} } }];
    if (quality !== undefined) told.unshift(/** @type {any} */ ({ ...keyframe(quality, nowMs), signal: "eye", number }));
    for (const data of told) worker.dispatchEvent(Object.assign(new Event("message"), { data }));
    const shown = store.reading("eye", nowMs).video;
    assert.ok(shown);
    images.show(shown, nowMs);
    return shown;
  };
  return { store, videos, worker, images, film };
}

test("a repeated image has the time of the first one, and ticks name the first one", () => {
  const { store, worker, images, film } = page(1);
  film(1, 0, 7);
  film(2, 800, 7);
  assert.deepEqual(images.report("eye", 810), [2, 10]);
  assert.equal(film(3, 1600).firstNumber, 1);
  assert.deepEqual(images.report("eye", 1610), [1, 10]);
  assert.equal(store.reading("eye", 1610).time, 0);
  assert.equal(images.share({ signal: "eye", slowMs: null, stopMs: 1500 }, 1610), 0);
  film(4, 1700, 8);
  assert.equal(film(5, 1800, 9).firstNumber, undefined);
  assert.deepEqual(images.report("eye", 1800), [5, 0]);
  assert.ok(worker.posted.every(({ isCompared }) => isCompared));
  assert.deepEqual(worker.posted.map(({ timeMs }) => timeMs), [0, 800, 1600, 1700, 1800]);
});

test("a video that was hidden while its picture stood still is not new when it is shown again", () => {
  const { videos, film } = page(1);
  film(1, 0, 7);
  film(2, 2000, 7);
  videos.keep([]);
  assert.equal(film(3, 9000, 7).firstNumber, 1);
});

test("a video without the key is not compared", () => {
  const { worker, film } = page(0);
  for (const number of [1, 2, 3]) assert.equal(film(number, 2000 * number).firstNumber, undefined);
  assert.ok(worker.posted.every(({ isCompared }) => isCompared === false));
});

test("a standing picture stays one after a change of the stream, until keyframes show motion", () => {
  const since = { number: 3, timeMs: 0 };
  const still = new StandingPictures();
  still.inherit(since);
  for (const timeMs of [5000, 6000, 7000]) {
    still.add(keyframe(1, timeMs));
    assert.deepEqual(still.first(timeMs, AFTER_MS), since);
  }
  const moving = new StandingPictures();
  moving.inherit(since);
  const found = [5000, 6000, 7000].map((timeMs, place) => {
    moving.add(keyframe(place, timeMs));
    return moving.first(timeMs, AFTER_MS);
  });
  assert.deepEqual(found, [since, since, null]);
});
