// What the command widgets reckon: steps, dials, typed numbers and bytes, lines, round trips.
import assert from "node:assert/strict";
import { test } from "node:test";

import { boundsOf, keyed, snapped } from "../../urc/web/static/widgets/command_kit.js";
import { Pull, angleOf, arc, ray, shareAt } from "../../widgets/knob/dial.js";
import { quality, Trips } from "../../widgets/link/trips.js";
import { chosen, fileOf } from "../../widgets/log/lines.js";
import { numberOf } from "../../widgets/number/typed.js";
import { hexOf, pairsOf, plain, Typed } from "../../widgets/terminal/hex.js";
import { measured } from "../../urc/web/static/widgets/motion.js";

const VOLTS = { type: "number", title: "", unit: "V", min: 0, max: 10, choices: [], default: null, allowsControl: false };

test("an option narrows what a command takes, and never widens it", () => {
  assert.deepEqual(boundsOf(VOLTS, {}), { min: 0, max: 10, step: 0.1, digits: 1, unit: "V" });
  assert.deepEqual(boundsOf(VOLTS, { min: -5, max: 4, step: 0.25 }), { min: 0, max: 4, step: 0.25, digits: 2, unit: "V" });
  assert.equal(boundsOf({ ...VOLTS, unit: "degC" }, {}).unit, "°C");
  const whole = boundsOf({ ...VOLTS, type: "integer", max: 1000 }, {});
  assert.deepEqual([whole.step, whole.digits], [10, 0]);
  assert.deepEqual(boundsOf(undefined, {}), { min: 0, max: 100, step: 1, digits: 0, unit: "" });
});

test("a bound that nobody has declared leaves room beyond the one that is", () => {
  const ends = (/** @type {object} */ declared, options = {}) => {
    const { min, max } = boundsOf({ ...VOLTS, min: null, max: null, ...declared }, options);
    return [min, max];
  };
  assert.deepEqual([ends({ min: 200 }), ends({ max: -5 }), ends({ max: 0 })], [[200, 300], [-105, -5], [-100, 0]]);
  assert.deepEqual([ends({ min: 5 }), ends({ max: 1000 }), ends({ min: -20 })], [[5, 100], [0, 1000], [-20, 100]]);
  assert.deepEqual([ends({}, { min: 200 }), ends({ min: 0 }, { max: -5 })], [[200, 300], [0, 0]]);
  assert.deepEqual(ends({ min: 0, max: 10 }, { min: 50 }), [10, 10]);
});

test("keys step, leap and go to the ends, on the grid and within the bounds", () => {
  const bounds = { min: 0, max: 10, step: 0.1 };
  assert.equal(keyed("ArrowRight", 0.2, bounds), 0.3);
  assert.equal(keyed("ArrowDown", 0, bounds), 0);
  assert.equal(keyed("PageUp", 2, bounds), 3);
  assert.equal(keyed("End", 2, bounds), 10);
  assert.equal(keyed("Enter", 2, bounds), null);
  assert.equal(snapped(3.26, { min: 0, max: 10, step: 0.5 }), 3.5);
  assert.equal(snapped(99, { min: 1, max: 10, step: 4 }), 10);
});

test("a dial goes three quarters round and does not leap over its gap", () => {
  assert.deepEqual([angleOf(0), angleOf(0.5), angleOf(1)], [-135, 0, 135]);
  assert.equal(shareAt(0, -1), 0.5);
  assert.equal(shareAt(0.1, 0.1), null);
  assert.equal(shareAt(-0.01, 1), 0);
  assert.equal(new Pull(0.97).to(-0.01, 1), 1);
  assert.equal(new Pull(0.1).to(0.3, 0.9), 0);
  assert.equal(new Pull(0.4).to(0, 0), 0.4);
  assert.match(arc(10, 0, 1), /^M-7.07 7.07A10 10 0 1 1 7.07 7.07$/);
  assert.equal(ray(1, 2, 0.5), "M0 -1L0 -2");
});

/** @param {number} share */
function rim(share) {
  const angle = (angleOf(share) * Math.PI) / 180;
  return /** @type {const} */ ([Math.sin(angle), -Math.cos(angle)]);
}

test("a quick finger that goes over the top is followed, however far it leaps", () => {
  for (const [from, to] of [[0.2, 0.75], [0.45, 0.98], [0.8, 0.2], [0, 0.6], [1, 0.4]]) {
    assert.equal(new Pull(from).to(...rim(to)).toFixed(3), to.toFixed(3), `${from} to ${to}`);
  }
  const pull = new Pull(0.95);
  for (const [x, y] of [[0.2, 1], [-0.2, 1], [-1, 0.5], [-1, -0.1]]) assert.equal(pull.to(x, y), 1);
  assert.equal(pull.to(...rim(0.9)).toFixed(3), "0.900", "back on its side of the gap");
});

test("a finger that goes through the middle of a dial leads its hand across, and to no end", () => {
  const pull = new Pull(shareAt(-1, 0.05) ?? NaN);
  const [left, right] = [shareAt(-0.5, 0.05), shareAt(0.5, 0.05)];
  assert.deepEqual([-0.5, -0.2, 0, 0.2, 0.5].map((x) => pull.to(x, 0.05)), [left, left, left, left, right]);
  const down = new Pull(0.4);
  for (const y of [0, 0.5, 0.9]) assert.equal(down.to(0.01, y), 0.4, "below the middle is only the gap");
  assert.equal(down.to(...rim(0.2)).toFixed(3), "0.200");
});

test("a number is taken as people write it, and refused with the reason", () => {
  const bounds = { min: -5, max: 10, unit: "V", isWhole: false };
  assert.deepEqual(numberOf(" 7,25 V", bounds), { value: 7.25 });
  assert.deepEqual(numberOf("−3", bounds), { value: -3 });
  assert.deepEqual(numberOf("1e1", bounds), { value: 10 });
  for (const [text, fault] of [["", "empty"], ["1.2.3", "none"], ["0x10", "none"], ["NaN", "none"], ["-6", "low"], ["11", "high"]]) {
    assert.deepEqual(numberOf(text, bounds), { fault });
  }
  assert.deepEqual(numberOf("2.5", { ...bounds, isWhole: true }), { fault: "whole" });
});

test("a comma is a point, or parts thousands; where it may be either, nobody guesses", () => {
  const bounds = { min: -Infinity, max: Infinity, unit: "m", isWhole: false };
  /** @type {[string, number][]} */
  const clear = [
    ["1,5", 1.5], ["7,25 m", 7.25], [",500", 0.5], ["0,500", 0.5], ["1234,567", 1234.567], ["1,0000", 1],
    ["1.000", 1], ["1.125", 1.125], ["1'000", 1000], ["1’000,5", 1000.5], ["1\u202f000,5", 1000.5], ["1'234,567", 1234.567],
    ["1,000,000", 1e6], ["1.000.000", 1e6], ["1,234.5", 1234.5], ["1.234,5", 1234.5], ["-1,234,567.25", -1234567.25],
  ];
  for (const [text, value] of clear) assert.deepEqual(numberOf(text, bounds), { value }, text);
  assert.deepEqual(numberOf("1,000", bounds), { fault: "comma", either: [1, 1000] });
  assert.deepEqual(numberOf("−12,345 m", bounds), { fault: "comma", either: [-12.345, -12345] });
  assert.deepEqual(numberOf("1,000", { ...bounds, max: 10, isWhole: true }), { fault: "comma", either: [1, 1000] });
  for (const text of ["1,00,000", "1.2.3", "1,2,3", "1.000,000.5", "12.34,5", "1,5.5", "1,2345.6", "1,,5"]) {
    assert.deepEqual(numberOf(text, bounds), { fault: "none" }, text);
  }
});

test("bytes are pairs of digits, and control characters are shown and not obeyed", () => {
  assert.deepEqual(pairsOf("0x06, 05 fF"), { value: "06 05 ff" });
  assert.deepEqual(pairsOf(" "), { fault: "empty" });
  assert.deepEqual(pairsOf("060"), { fault: "odd" });
  assert.deepEqual(pairsOf("0g"), { fault: "letters" });
  assert.deepEqual(pairsOf("00".repeat(513)), { fault: "long" });
  assert.equal(hexOf("Aé"), "41 c3 a9");
  assert.equal(plain("\x1b[31mred\x07\x9b"), "␛[31mred␇�");
});

test("lines that were typed come back in both directions, and the draft is kept", () => {
  const typed = new Typed(["a"]);
  typed.add("b");
  typed.add("b");
  assert.deepEqual(typed.lines, ["a", "b"]);
  assert.deepEqual(
    [typed.go(-1, "new"), typed.go(-1, "b"), typed.go(-1, "a"), typed.go(1, "a"), typed.go(1, "b"), typed.go(1, "new")],
    ["b", "a", "a", "b", "new", "new"],
  );
});

const LINES = [
  { number: 0, time: 0, level: "info", source: "wire", text: "connected" },
  { number: 1, time: 1000, level: "warning", source: "wire", text: "late\tanswer" },
  { number: 2, time: 2000, level: "error", source: "arm", text: "lost" },
];

test("lines are chosen by level and by all words, the newest of them", () => {
  const numbers = (wanted) => chosen(LINES, { level: "info", words: "", most: 9, ...wanted }).map(({ number }) => number);
  assert.deepEqual(numbers({}), [0, 1, 2]);
  assert.deepEqual(numbers({ level: "warning" }), [1, 2]);
  assert.deepEqual(numbers({ words: "ANSWER wire" }), [1]);
  assert.deepEqual(numbers({ most: 1 }), [2]);
  assert.equal(fileOf(LINES.slice(1, 2)), "1970-01-01T00:00:01.000Z\twarning\twire\tlate answer\n");
});

test("round trips have a middle, a tail and a grade", () => {
  const trips = new Trips();
  assert.deepEqual([trips.share(0.5), trips.late()], [null, null]);
  for (const ms of [10, 20, 30, 300]) trips.add(ms);
  assert.deepEqual([trips.share(0.5), trips.share(0.95), trips.late()], [30, 300, 0.25]);
  assert.deepEqual([null, 10, 150, 400].map(quality), ["", "good", "caution", "bad"]);
});

test("the value of a lever has a sign and the declared unit, and is empty at rest", () => {
  const lift = { ...VOLTS, name: "lift", unit: "m/s", min: -0.5, max: 2 };
  assert.deepEqual([0.25, -0.5, 0, 0.001].map((value) => measured(value, lift)), ["+0.50 m/s", "−0.25 m/s", "", ""]);
  assert.deepEqual([0.25, -1, 0].map((value) => measured(value, undefined)), ["+25 %", "−100 %", ""]);
});
