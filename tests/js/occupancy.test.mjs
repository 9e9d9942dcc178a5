// The images of occupancy grids: their place, their colours, and images that are none.
import assert from "node:assert/strict";
import { test } from "node:test";
import { inflateSync } from "node:zlib";

import { arrowOf, ellipseOf, pairsOf, posesOf, wrapped } from "../../widgets/map/geo.js";
import { between, cornersOf, crc32, partsOf, placeOfGrid, recoloured, sizeText } from "../../widgets/map/grid_image.js";

// A grid of 3 by 2 cells as the server sends it: 50 99 1 above 0 100 -1.
const IMAGE = Uint8Array.from(Buffer.from([
  "iVBORw0KGgoAAAANSUhEUgAAAAMAAAACCAMAAACqqpYoAAADAFBMVEX+/v77+/v5+fn29vb09PTx8fHv7+/s7Ozq6urn5+fl5eXi4uLg4ODd3d",
  "3a2trY2NjV1dXT09PQ0NDOzs7Ly8vJycnGxsbExMTBwcG+vr68vLy5ubm3t7e0tLSysrKvr6+tra2qqqqoqKilpaWjo6OgoKCdnZ2bm5uYmJiW",
  "lpaTk5ORkZGOjo6MjIyJiYmHh4eEhISCgoJ/f398fHx6enp3d3d1dXVycnJwcHBtbW1ra2toaGhmZmZjY2NhYWFeXl5bW1tZWVlWVlZUVFRRUV",
  "FPT09MTExKSkpHR0dFRUVCQkJAQEA9PT06Ojo4ODg1NTUzMzMwMDAuLi4rKyspKSkmJiYkJCQhISEeHh4cHBwZGRkXFxcUFBQSEhIPDw8NDQ0K",
  "CgoICAgFBQUDAwMAAADNzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc",
  "3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3N",
  "zc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc",
  "3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3N",
  "zc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc",
  "3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc3Nzc1U9CcTAAAAT3RFWHR1cmMg",
  "b2NjdXBhbmN5IGdyaWQAeyJmcmFtZSI6Im1hcCIsInJlc29sdXRpb24iOjAuMDUsIngiOi0xLjUsInkiOjIuMCwieWF3IjowLjd9/TRk2wAAAB",
  "BJREFUeAFjMEpmZGBI+Q8ABYQB+mF5we8AAAAASUVORK5CYII=",
].join(""), "base64"));

/** @param {Uint8Array} image @returns {Map<string, Buffer>} the chunks of an image, whose checksums must be right */
function chunksOf(image) {
  const data = Buffer.from(image);
  const found = new Map();
  for (let at = 8; at < data.length; at += 12 + data.readUInt32BE(at)) {
    const end = at + 8 + data.readUInt32BE(at);
    assert.equal(data.readUInt32BE(end), crc32(data.subarray(at + 4, end)));
    found.set(data.toString("latin1", at + 4, at + 8), data.subarray(at + 8, end));
  }
  return found;
}

/** @param {Uint8Array} image @param {string} from @param {string} to */
function edited(image, from, to) {
  return Uint8Array.from(Buffer.from(Buffer.from(image).toString("latin1").replace(from, to), "latin1"));
}

test("the checksum is the one that everybody uses", () => {
  assert.equal(crc32(Buffer.from("123456789")), 0xcbf43926);
});

test("the place is in the text of the image", () => {
  const place = placeOfGrid(IMAGE);
  assert.deepEqual(place, { width: 3, height: 2, resolution: 0.05, x: -1.5, y: 2, yaw: 0.7, frame: "map" });
  assert.ok(place);
  assert.equal(sizeText({ ...place, resolution: 2.5 }), "7.5 × 5.0 m");
});

test("an image that is no grid has no place", () => {
  for (const bad of [
    new Uint8Array(0),
    new Uint8Array(100),
    IMAGE.slice(0, 60),
    edited(IMAGE, "urc occupancy", "urc occupanzy"),
    edited(IMAGE, '"resolution":0.05', '"resolution":0.00'),
    edited(IMAGE, '"resolution":0.05', '"resolution":"05"'),
    edited(IMAGE, '{"frame"', '["frame"'),
    edited(IMAGE, '"yaw":0.7', '"yaw":"7"'),
    edited(IMAGE, "\0\0\0\x03\0\0\0\x02\b", "\0\x01\0\0\0\0\0\x02\b"),
    edited(IMAGE, "\0\0\0\x03\0\0\0\x02\b", "\0\0\0\0\0\0\0\x02\b"),
  ]) assert.equal(placeOfGrid(bad), null);
});

test("other colours leave the cells as they are", () => {
  const seen = new Set();
  const parts = recoloured(IMAGE, (value) => {
    seen.add(value);
    return value < 0 ? [1, 2, 3, 0] : [value, value, value, 255];
  });
  const made = chunksOf(Buffer.concat(parts));
  assert.deepEqual([...made.keys()], ["IHDR", "PLTE", "tRNS", "tEXt", "IDAT", "IEND"]);
  assert.deepEqual([Math.min(...seen), Math.max(...seen)], [-1, 100]);
  assert.deepEqual([...(made.get("PLTE")?.subarray(150, 153) ?? [])], [50, 50, 50]);
  assert.deepEqual([...(made.get("PLTE")?.subarray(765) ?? [])], [1, 2, 3]);
  assert.deepEqual([made.get("tRNS")?.[100], made.get("tRNS")?.[101], made.get("tRNS")?.[255]], [255, 0, 0]);
  assert.deepEqual([...inflateSync(made.get("IDAT") ?? "")], [0, 50, 99, 1, 0, 0, 100, 255]);
});

test("the corners turn with the origin", () => {
  const place = { width: 4, height: 2, resolution: 0.5, x: 1, y: 10, yaw: Math.PI / 2, frame: "" };
  const corners = cornersOf(place).map((pair) => pair.map((one) => Math.round(one * 1e6) / 1e6));
  assert.deepEqual(corners, [[10, 1], [12, 1], [12, 0], [10, 0]]);
});

test("colours come from the browser's words for them", () => {
  assert.deepEqual(partsOf("rgb(1, 2, 3)"), [1, 2, 3]);
  assert.deepEqual(partsOf("rgba(1, 2, 3, 0.5)"), [1, 2, 3]);
  assert.deepEqual(partsOf(""), [128, 128, 128]);
  assert.deepEqual(between([0, 0, 0], [100, 200, 50], 0.5), [50, 100, 25]);
});

test("points come in pairs of x and y, without bad ones", () => {
  assert.deepEqual(pairsOf([1, 2, null, 3, 4, 5, 1e9, 0, 6]), [[2, 1], [5, 4]]);
  for (const bad of [null, "1,2", 5, {}, []]) assert.deepEqual(pairsOf(bad), []);
});

test("an ellipse has the spread of the covariance, and turns with it", () => {
  const corners = ellipseOf([10, 20], [4, 0, 0, 1]);
  const [ys, xs] = [corners.map(([y]) => y - 10), corners.map(([, x]) => x - 20)];
  assert.ok(Math.abs(Math.max(...xs) - 2 * Math.sqrt(5.991)) < 1e-9);
  assert.ok(Math.abs(Math.max(...ys) - Math.sqrt(5.991)) < 0.01);
  const ros = new Array(36).fill(0);
  [ros[0], ros[1], ros[6], ros[7], ros[35]] = [1, 0.99, 0.99, 1, 5];
  const [, farthest] = ellipseOf([0, 0], ros).reduce(([far, at], place) => {
    const one = Math.hypot(...place);
    return one > far ? [one, place] : [far, at];
  }, [0, [0, 0]]);
  assert.ok(Math.abs(Math.abs(farthest[0]) - Math.abs(farthest[1])) < 0.01 && farthest[0] * farthest[1] > 0);
  for (const bad of [[1, 2, 2, 1], [1, 2, 3], [0, 0, 0, 0], [null, 0, 0, 1], null, [-1, 0, 0, -1]]) assert.deepEqual(ellipseOf([0, 0], bad), []);
});

test("an arrow points where the yaw says", () => {
  const [start, end] = arrowOf([1, 2], Math.PI / 2, 3);
  assert.deepEqual(start, [1, 2]);
  assert.ok(Math.abs((end?.[0] ?? 0) - 4) < 1e-9 && Math.abs((end?.[1] ?? 0) - 2) < 1e-9);
  assert.ok(Math.abs(wrapped(3.5) - (3.5 - 2 * Math.PI)) < 1e-9);
});

test("poses are read with their directions, without invalid ones", () => {
  assert.deepEqual(posesOf([1, 2, 1, 0, 3, 4, 0, 1]), [{ place: [2, 1], yaw: Math.PI }, { place: [4, 3], yaw: 0 }]);
  assert.deepEqual(posesOf([1, 2, null, 0, 1e9, 4, 0, 1, Number.NaN, 1, 0, 1, 1, 2, 0]), []);
  for (const value of [null, "x", 5, {}]) assert.deepEqual(posesOf(value), []);
});
