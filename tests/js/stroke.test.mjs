import assert from "node:assert/strict";
import { test } from "node:test";
import { cutTo, distance, fitted, lengthOf, polar, simplified } from "../../urc/web/static/widgets/path_simplify.js";

test("a line is simplified within its tolerance, and keeps its ends", () => {
  const wave = Array.from({ length: 200 }, (_, step) => [step / 20, Math.sin(step / 20)]);
  for (const tolerance of [0, 0.01, 0.1, 1]) {
    const kept = simplified(wave, tolerance);
    assert.deepEqual([kept[0], kept.at(-1)], [wave[0], wave.at(-1)]);
    for (const point of wave) {
      const off = Math.min(...kept.slice(1).map((to, place) => distance(point, kept[place], to)));
      assert.ok(off <= tolerance + 1e-12);
    }
  }
  assert.ok(simplified(wave, 0.1).length < 20);
});

test("a straight line has two points, and a dot stays one", () => {
  assert.deepEqual(simplified([[0, 0], [1, 1], [2, 2], [3, 3]], 0.001), [[0, 0], [3, 3]]);
  assert.deepEqual(simplified([[1, 1]], 1), [[1, 1]]);
  assert.deepEqual(simplified([], 1), []);
  assert.deepEqual(simplified([[0, 0], [0, 0], [0, 0]], 0), [[0, 0], [0, 0]]);
  const long = Array.from({ length: 1500 }, (_, step) => [step % 2, step]);
  assert.equal(simplified(long, 0).length, 1500); // no recursion to overflow
});

test("ahead is nought, to the left is positive", () => {
  assert.deepEqual(polar(2, 0), { heading: 0, distance: 2 });
  assert.equal(polar(0, 1).heading, Math.PI / 2);
  assert.ok(polar(0, -1).heading < 0);
  assert.deepEqual(polar(0, 0), { heading: 0, distance: 0 });
});

test("a vector is cut to the longest, and keeps its direction", () => {
  assert.deepEqual(cutTo(3, 4, 10), [3, 4]);
  assert.deepEqual(cutTo(30, 40, 5), [3, 4]);
  assert.deepEqual(cutTo(0, 0, 5), [0, 0]);
});

test("a line is as long as its stretches", () => {
  assert.equal(lengthOf([[0, 0], [3, 4], [3, 5]]), 6);
  assert.equal(lengthOf([[1, 1]]), 0);
  assert.equal(lengthOf([]), 0);
});

test("strokes become one line, of so many points at most", () => {
  const wave = Array.from({ length: 400 }, (_, step) => [step / 400, Math.sin(step / 7) / 3]);
  assert.deepEqual(fitted([[[0, 0]], [[1, 0], [1, 0.5], [1, 1]]], 0.01, 10), [[0, 0], [1, 0], [1, 1]]);
  for (const most of [2, 3, 10, 50]) {
    const line = fitted([wave, [[1, 1]]], 0, most);
    assert.ok(line.length <= most && line.length >= 2);
    assert.deepEqual([line[0], line.at(-1)], [wave[0], [1, 1]]);
  }
  assert.deepEqual(fitted([], 0.01, 10), []);
});
