// @ts-check
/** Numbers as people read them: what is converted loses nothing, and gains no digits. */
import assert from "node:assert/strict";
import { test } from "node:test";

import { digitsIn, format } from "../../urc/web/static/widgets/kit.js";
import { textOf } from "../../urc/web/static/core/formatting.js";
import { Store } from "../../urc/web/static/live/store.js";

/**
 * @param {number | number[]} value
 * @param {Partial<import("../../urc/web/static/core/types.js").Signal>} signal
 * @param {string} [system]
 * @param {import("../../urc/web/static/core/types.js").Conversion} [conversion]
 */
function shown(value, signal, system = "imperial", conversion) {
  const store = new Store();
  /** @type {any} */
  const hello = { now: 0, signals: [{ name: "s", type: "number", ...signal }] };
  store.hello(hello, 0);
  store.setUnits(system);
  store.setUp(true, 0);
  store.values({ n: 0, i: [0], v: [value], a: [0] }, 0);
  const { text, unit } = store.reading("s", 0, conversion);
  return `${text} ${unit}`.trim();
}

test("a precision means the declared unit, and tells the same apart in another", () => {
  assert.equal(shown(12, { unit: "mm", precision: 0 }), "0.47 in");
  assert.equal(shown(13, { unit: "mm", precision: 0 }), "0.51 in");
  assert.equal(shown(5000, { unit: "Pa", precision: 0 }), "0.7252 psi");
  assert.equal(shown(5000, { unit: "Pa", precision: 0 }, "everyday"), "50.00 hPa");
  assert.equal(shown(21, { unit: "degC", precision: 0 }), "70 °F");
  assert.equal(shown(300, { unit: "K", precision: 2 }), "80.33 °F");
  assert.equal(shown(10, { unit: "m/s", precision: 1 }), "22.4 mph");
  assert.equal(shown(1, { unit: "rad", precision: 2 }), "57.3 °");
  assert.equal(shown(12, { unit: "mm", precision: 0 }, ""), "12 mm");
});

test("a precision means the declared unit also where a widget asks for another", () => {
  const conversion = { factor: 0.001, offset: 0, symbol: "m" };
  assert.equal(shown(12, { unit: "mm", precision: 0 }, "", conversion), "0.012 m");
  assert.equal(shown(12, { unit: "mm", precision: 0 }, "imperial", conversion), "0.039 ft");
});

test("without a precision a conversion adds no digits, and takes none that came", () => {
  assert.equal(shown(9, { unit: "m/s" }), "20.13 mph");
  assert.equal(shown(10, { unit: "m/s" }), "22.37 mph");
  assert.equal(shown(1.3, { unit: "m" }), "4.265 ft");
  assert.equal(shown(0, { unit: "m" }), "0 ft");
  assert.equal(shown(0.8123456, { unit: "rad" }), "46.54397 °");
  assert.equal(shown(12345.678, { unit: "m" }), "40504.19 ft");
  assert.equal(shown(273.15, { unit: "K" }, "everyday"), "0 °C");
  assert.equal(shown(459.67 / 1.8, { unit: "K" }), "0 °F");
  assert.equal(shown([0.3, 0.1 + 0.2], { unit: "m" }), "0.9843, 0.9843 ft");
  assert.equal(shown(0.1 + 0.2, { unit: "m" }, ""), "0.3 m");
  assert.equal(shown(1e-9, { unit: "m" }, ""), "1e-9 m");
});

test("a float of 32 bits shows the digits that it has", () => {
  assert.equal(shown(73.0000019073486, { unit: "%" }, ""), "73 %");
  assert.equal(shown(Math.fround(3.3), { unit: "V" }, ""), "3.3 V");
  assert.equal(shown(Math.fround(-0.1234567), { unit: "m" }, ""), "-0.1234567 m");
  assert.equal(shown(123456789.25, { unit: "m" }, ""), "123456789 m");
  assert.equal(shown(46.52193847, { unit: "deg", precision: 8 }, ""), "46.52193847 °");
});

test("nothing is a negative zero", () => {
  assert.equal(textOf(-0.04, { name: "s", type: "number", precision: 1 }), "0.0");
  assert.equal(shown(-0.04, { unit: "m/s", precision: 0 }), "0 mph");
  assert.equal(textOf(-0, { name: "s", type: "number" }), "0");
  assert.equal(format(-0.001), "-0.001");
});

test("four digits round no whole number", () => {
  assert.equal(format(12345), "12345");
  assert.equal(format(-123456.789), "-123457");
  assert.equal(format(1234.56), "1235");
  assert.equal(format(0.0123456), "0.01235");
  assert.equal(format(9999.96), "10000");
});

test("words for a number are those of what the robot said", () => {
  const signal = { name: "s", type: "number", states: { 3: "fast" } };
  const twice = (/** @type {number} */ value) => value * 2;
  assert.deepEqual([textOf(3, signal, twice), textOf(1.5, signal, twice)], ["fast", "3"]);
});

test("digits in another unit are those that keep the smallest step", () => {
  const inches = (/** @type {number} */ value) => value / 25.4;
  const same = (/** @type {number} */ value) => value;
  assert.deepEqual([digitsIn(0, inches), digitsIn(2, same), digitsIn(undefined, inches)], [2, 2, undefined]);
  assert.equal(digitsIn(0, (value) => value * 1.8 - 459.67), 0);
  assert.equal(digitsIn(1, (value) => value - 273.15), 1);
});
