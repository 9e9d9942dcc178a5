// Point clouds on the page: the file of the server, its positions and its colours.
import assert from "node:assert/strict";
import { test } from "node:test";

import { PCDLoader } from "three/addons/loaders/PCDLoader.js";

import { coloursOf, placesOf, rangeOf, readCloud } from "../../widgets/scene3d/cloud.js";

/**
 * Return a file as the server writes it.
 *
 * @param {readonly (readonly number[])[]} points
 * @param {string} colour
 */
function fileOf(points, colour = "intensity") {
  const names = ["x", "y", "z", colour].filter(Boolean);
  const types = names.map((name) => (name === "rgb" ? "U" : "F"));
  const four = names.map(() => 4);
  const one = names.map(() => 1);
  const rest = [
    "VERSION 0.7", `FIELDS ${names.join(" ")}`, `SIZE ${four.join(" ")}`, `TYPE ${types.join(" ")}`, `COUNT ${one.join(" ")}`,
    `WIDTH ${points.length}`, "HEIGHT 1", "VIEWPOINT 0 0 0 1 0 0 0", `POINTS ${points.length}`, "DATA binary\n",
  ].join("\n");
  const first = '# urc point cloud {"frame":"lidar","total":9000}';
  const head = `${first}${" ".repeat((7 * 4 - ((first.length + 1 + rest.length) % 4)) % 4)}\n${rest}`;
  const data = new DataView(new ArrayBuffer(head.length + 4 * names.length * points.length));
  new Uint8Array(data.buffer).set(Buffer.from(head, "latin1"));
  let at = head.length;
  for (const point of points) {
    point.forEach((value, place) => {
      if (types[place] === "U") data.setUint32(at, value, true);
      else data.setFloat32(at, value, true);
      at += 4;
    });
  }
  return data.buffer;
}

/** @param {number} share @returns {readonly [number, number, number]} */
const grey = (share) => [share, share, share];
const POINTS = [[1, 2, 3, 10], [-1, 0.5, 0, 20], [4, 5, 6, 30]];

test("the points are those that another reader of PCD files finds", () => {
  const file = fileOf(POINTS);
  const theirs = new PCDLoader().parse(file).geometry;
  const cloud = readCloud(file);
  assert.deepEqual([cloud.count, cloud.colour, cloud.total, cloud.frame], [3, "intensity", 9000, "lidar"]);
  assert.deepEqual([...placesOf(cloud, 100, "FLU")], [...theirs.getAttribute("position").array]);
  assert.deepEqual(POINTS.map((_, at) => cloud.numbers[4 * at + 3]), [...theirs.getAttribute("intensity").array]);
});

test("the colours of points are those that another reader finds", () => {
  const file = fileOf([[0, 0, 0, 0x00ff8001], [1, 1, 1, 0x000080ff]], "rgb");
  const theirs = [...new PCDLoader().parse(file).geometry.getAttribute("color").array];
  const cloud = readCloud(file);
  const ours = [...coloursOf(cloud, placesOf(cloud, 9, "FLU"), "field", grey)];
  assert.equal(ours.length, 6);
  ours.forEach((part, at) => assert.ok(Math.abs(part - (theirs[at] ?? NaN)) < 1e-4, `${part} is not ${theirs[at]}`));
});

test("in FRD, y and z have the other direction", () => {
  assert.deepEqual([...placesOf(readCloud(fileOf([[1, 2, 3, 4]])), 9, "FRD")], [1, -2, -3]);
});

test("a budget thins the places and the colours alike", () => {
  const points = Array.from({ length: 10 }, (_, at) => [at, 0, 0, at]);
  const cloud = readCloud(fileOf(points));
  const places = placesOf(cloud, 4, "FLU");
  assert.deepEqual([...places].filter((_, at) => at % 3 === 0), [0, 3, 6, 9]);
  const colours = coloursOf(cloud, places, "field", grey);
  assert.equal(colours.length, places.length);
  assert.ok((colours[3] ?? 0) < (colours[6] ?? 0));
});

test("the colour field or the height determines the colour", () => {
  const cloud = readCloud(fileOf([[0, 0, 5, 1], [0, 0, 1, 2]]));
  const places = placesOf(cloud, 9, "FLU");
  assert.deepEqual([...coloursOf(cloud, places, "field", grey)], [0, 0, 0, 1, 1, 1]);
  assert.deepEqual([...coloursOf(cloud, places, "height", grey)], [1, 1, 1, 0, 0, 0]);
  const plain = readCloud(fileOf([[0, 0, 5], [0, 0, 1]], ""));
  assert.deepEqual([...coloursOf(plain, placesOf(plain, 9, "FLU"), "field", grey)], [1, 1, 1, 0, 0, 0]);
});

test("a single outlier does not take all colours, and unknown values have the first", () => {
  const values = Float32Array.from([...Array.from({ length: 200 }, (_, at) => at), 1e9, NaN]);
  const [low, high] = rangeOf(values, 1, 0);
  assert.ok(low >= 0 && high <= 199, `${low} to ${high}`);
  const cloud = readCloud(fileOf([[0, 0, 0, NaN], [0, 0, 0, 1], [0, 0, 0, 2]]));
  assert.deepEqual([...coloursOf(cloud, placesOf(cloud, 9, "FLU"), "field", grey)], [0, 0, 0, 0, 0, 0, 1, 1, 1]);
});

test("a cloud without points is drawn as nothing", () => {
  const cloud = readCloud(fileOf([]));
  assert.equal(placesOf(cloud, 9, "FLU").length, 0);
  assert.equal(coloursOf(cloud, new Float32Array(0), "field", grey).length, 0);
});

test("another file is refused", () => {
  const file = fileOf(POINTS);
  const bad = [new ArrayBuffer(0), new ArrayBuffer(99), file.slice(0, 60), file.slice(0, file.byteLength - 1)];
  for (const one of bad) assert.throws(() => readCloud(one));
  const text = Buffer.from(file).toString("latin1");
  for (const [from, to] of [["POINTS 3", "POINTS 9"], ["x y z", "y x z"], ["urc point", "urx point"], ['{"frame"', '["frame"']]) {
    const other = Uint8Array.from(Buffer.from(text.replace(from ?? "", to ?? ""), "latin1"));
    assert.throws(() => readCloud(other.buffer));
  }
});
