// @ts-check
/** What a page reports of the images that it shows, and how it explains a slow robot. */
import assert from "node:assert/strict";
import test from "node:test";
import { ShownImages } from "../../urc/web/static/control/shown_images.js";

const SIGHT = { signal: "front", slowMs: 200, stopMs: 600 };

/** @param {number} number @param {number} timeMs */
function front(number, timeMs) {
  return { signal: "front", number, timeMs };
}

test("a page that has drawn no image reports none, and sees nothing", () => {
  const images = new ShownImages();
  assert.equal(images.report("front", 1000), undefined);
  assert.equal(images.share(SIGHT, 1000), 0);
});

test("it reports the number of the image, and since when it is drawn, but no time of day", () => {
  const images = new ShownImages();
  images.show(front(7, 900), 1000);
  assert.deepEqual(images.report("front", 1000), [7, 0]);
  assert.deepEqual(images.report("front", 1040.7), [7, 40]);
  assert.equal(images.report("rear", 1040), undefined);
});

test("an image that is drawn again was drawn before", () => {
  const images = new ShownImages();
  images.show(front(7, 900), 1000);
  images.show(front(7, 900), 1300);
  assert.deepEqual(images.report("front", 1300), [7, 300]);
});

test("a newer image counts although it is older, because the camera repeats it", () => {
  const images = new ShownImages();
  images.show(front(7, 900), 1000);
  images.show(front(8, 100), 1050);
  assert.deepEqual(images.report("front", 1050), [8, 0]);
  assert.equal(images.share(SIGHT, 1050), 0);
  images.clear();
  images.show(front(2 ** 32 - 1, 100), 1100);
  images.show(front(0, 90), 1150);
  assert.deepEqual(images.report("front", 1150), [0, 0], "the numbers begin again");
});

test("of two widgets with one camera, the one with the newer image counts", () => {
  const images = new ShownImages();
  images.show(front(8, 950), 1000);
  images.show(front(7, 900), 1001);
  assert.deepEqual(images.report("front", 1001), [8, 1]);
});

test("image numbers start again with a new connection", () => {
  const images = new ShownImages();
  images.show(front(7, 900), 1000);
  images.clear();
  assert.equal(images.report("front", 1000), undefined);
});

test("the share of the speed is that of the server", () => {
  const images = new ShownImages();
  images.show(front(7, 1000), 1000);
  const shares = [1100, 1200, 1300, 1400, 1600, 9000].map((nowMs) => images.share(SIGHT, nowMs));
  assert.deepEqual(shares, [1, 1, 0.75, 0.5, 0, 0]);
  assert.equal(images.share({ ...SIGHT, slowMs: null }, 1599), 1);
});
