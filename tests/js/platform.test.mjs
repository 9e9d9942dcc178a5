// @ts-check
/** The parts of the page that know no page: budget, pictures, follow, frames, units, store, kit. */
import assert from "node:assert/strict";
import { test } from "node:test";

import { RenderBudget } from "../../urc/web/static/widgets/render_budget.js";
import { PageTopics, Log } from "../../urc/web/static/live/page_topics.js";
import { frameOf } from "../../urc/web/static/live/frames.js";
import { DASH, clamp, format, many, number, numbers, t } from "../../urc/web/static/widgets/kit.js";
import { Decoder } from "../../urc/web/static/widgets/image_decoder.js";
import { Store } from "../../urc/web/static/live/store.js";
import { Units, converted } from "../../urc/web/static/core/units.js";

test("a widget that is long in twenty of sixty calls is called once a second", () => {
  const budget = new RenderBudget();
  for (let call = 0; call < 19; call += 1) budget.count(call * 16, 51);
  assert.equal(budget.isSlow, false);
  budget.count(19 * 16, 51);
  assert.equal(budget.isSlow, true);
  assert.equal(budget.allows(19 * 16 + 999), false);
  assert.equal(budget.allows(19 * 16 + 1000), true);
});

test("long calls that are sixty calls ago are forgotten, and one that got quick is quick again", () => {
  const budget = new RenderBudget();
  for (let call = 0; call < 600; call += 1) budget.count(call * 16, call % 4 === 0 ? 60 : 1);
  assert.equal(budget.isSlow, false);
  for (let call = 0; call < 20; call += 1) budget.count(10_000 + call, 60);
  assert.equal(budget.isSlow, true);
  for (let call = 0; call < 61; call += 1) budget.count(20_000 + call * 1000, 1);
  assert.equal(budget.isSlow, false);
});

test("one that stops the page even once a second has spent what it had", () => {
  const budget = new RenderBudget();
  for (let call = 0; call < 29; call += 1) budget.count(call * 1000, 600);
  assert.equal(budget.isSpent, true);
});

/** @param {string} name */
function bitmap(name) {
  return { name, isClosed: false, width: 1, height: 1, close() { this.isClosed = true; } };
}

test("of three images that come while one is decoded, only the newest is decoded next", async () => {
  /** @type {((value: ImageBitmap) => void)[]} */
  const waiting = [];
  /** @type {number[]} */
  const shown = [];
  const decoder = new Decoder(
    (_, picture) => shown.push(picture.serial),
    () => assert.fail("nothing failed"),
    () => new Promise((resolve) => waiting.push(resolve)),
  );
  const blob = new Blob(["x"]);
  for (const serial of [1, 2, 3, 4]) decoder.take({ blob, type: "image/png", serial });
  assert.equal(waiting.length, 1);
  const [first, second] = [bitmap("a"), bitmap("b")];
  waiting[0]?.(/** @type {any} */ (first));
  await new Promise((resolve) => setImmediate(resolve));
  assert.deepEqual([shown, waiting.length, first.isClosed], [[1], 2, false]);
  waiting[1]?.(/** @type {any} */ (second));
  await new Promise((resolve) => setImmediate(resolve));
  assert.deepEqual([shown, first.isClosed, second.isClosed], [[1, 4], true, false]);
  decoder.take({ blob, type: "image/png", serial: 4 });
  assert.equal(waiting.length, 2, "what is shown already is not decoded again");
  decoder.end();
  assert.equal(second.isClosed, true);
});

test("each reading of a counted signal is heard once, and what is missing is told", () => {
  const store = new Store();
  store.names = ["a", "b"];
  store.each.begin("one");
  const end = new AbortController();
  /** @type {unknown[]} */
  const heard = [];
  for (const name of store.names) {
    store.each.listen(name, (missed) => heard.push([name, store.samples.get(name)?.value, missed]), end.signal);
  }
  /** @param {number[]} i @param {number[]} v @param {Record<number, number>} [e] */
  const frame = (i, v, e) => {
    heard.length = 0;
    store.values({ n: 0, i, v, a: 0, ...(e && { e }) }, 0);
    return heard;
  };
  assert.deepEqual(frame([0, 1], [5, 9], { 0: 40 }), [["a", 5, 0], ["b", 9, 0]], "what was before is not missed");
  assert.deepEqual(frame([0, 0, 1], [6, 7, 9], { 0: 41 }), [["a", 6, 0], ["a", 7, 0], ["b", 9, 0]]);
  store.each.begin("one");
  const before = store.samples.get("a")?.serial;
  assert.deepEqual(frame([0], [7], { 0: 42 }), [], "told again after a cut");
  assert.equal(store.samples.get("a")?.serial, before);
  assert.deepEqual(frame([0, 0], [8, 8], { 0: 46 }), [["a", 8, 3], ["a", 8, 0]]);
  store.each.begin("two");
  assert.deepEqual(frame([0], [8], { 0: 1 }), [["a", 8, 0]], "another session counts anew");
  end.abort();
  assert.deepEqual(frame([0], [8], { 0: 2 }), []);
});

test("an image that is none is told, and the next one is shown", async () => {
  const faults = [];
  const shown = [];
  const decoder = new Decoder(
    () => shown.push(1),
    (error) => faults.push(error),
    async (blob) => {
      if (blob.size === 1) throw new Error("no image");
      return /** @type {any} */ (bitmap("b"));
    },
  );
  decoder.take({ blob: new Blob(["x"]), type: "", serial: 1 });
  await new Promise((resolve) => setImmediate(resolve));
  decoder.take({ blob: new Blob(["xy"]), type: "", serial: 2 });
  await new Promise((resolve) => setImmediate(resolve));
  assert.deepEqual([faults.length, shown.length], [1, 1]);
});

test("who follows is told in a frame: at once, on change, and not after the end", () => {
  let name = "dark";
  let woken = 0;
  const theme = () => ({ look: name, value: { name } });
  const follows = new PageTopics(/** @type {any} */ ({ theme }), () => (woken += 1));
  const end = new AbortController();
  /** @type {string[]} */
  const told = [];
  follows.listen("theme", (news) => told.push(news.name), end.signal);
  assert.deepEqual([told, woken], [[], 1]);
  follows.frame();
  follows.frame();
  name = "night";
  follows.frame();
  end.abort();
  name = "light";
  follows.frame();
  assert.deepEqual(told, ["dark", "night"]);
  assert.throws(() => follows.listen(/** @type {any} */ ("weather"), () => {}, end.signal), /only theme/);
});

/** @param {number} count @param {number} [from] */
function lines(count, from = 0) {
  return Array.from({ length: count }, (_, index) => ({
    age: 0,
    level: /** @type {"info"} */ ("info"),
    source: "wire",
    text: `line ${from + index}`,
  }));
}

test("lines of the log that come again are skipped, and lost ones are counted", () => {
  const log = new Log();
  log.add(lines(3), 0, "one");
  log.add(lines(4, 1), 1, "one");
  assert.deepEqual(log.lines.map(({ number, text }) => `${number} ${text}`), [
    "0 line 0", "1 line 1", "2 line 2", "3 line 3", "4 line 4",
  ]);
  log.add(lines(1, 9), 9, "one");
  assert.equal(log.news().value.missing, 4);
  log.add(lines(600), 100, "two");
  assert.deepEqual([log.lines.length, log.lines.at(-1)?.number], [500, 699]);
});

/** @param {Partial<import("../../urc/web/static/core/types.js").Signal>[]} signals */
function storeOf(...signals) {
  const store = new Store();
  const named = signals.map((signal, index) => ({ name: `s${index}`, type: "number", ...signal }));
  store.hello({ robot: "", title: "", now: 0, signals: named }, 0);
  store.setUp(true, 0);
  return store;
}

test("elements of an array are converted like a number, and its limits too", () => {
  const store = storeOf({ type: "array", unit: "rad", max: 2, limits: { high: 1 } });
  store.values({ n: 0, i: [0], v: [[0, 1, null]], a: [0] }, 0);
  const reading = store.reading("s0", 0, { factor: 10, offset: 1, symbol: "dd" });
  assert.deepEqual(reading.value, [1, 11, null]);
  assert.deepEqual([reading.signal.unit, reading.signal.max, reading.signal.limits?.high], ["dd", 21, 11]);
});

test("people see their own units, the value stays as it is declared", () => {
  const store = storeOf({ unit: "m/s", precision: 1 });
  store.setUnits("everyday");
  store.values({ n: 0, i: [0], v: [10], a: [0] }, 0);
  const { value, text, unit } = store.reading("s0", 0);
  assert.deepEqual([value, text, unit], [10, "36.0", "km/h"]);
  assert.equal(new Units("imperial").shown("degC").symbol, "°F");
  assert.equal(converted(100, new Units("imperial").shown("degC")), 212);
  assert.equal(new Units("toString").shown("m").symbol, "m");
  assert.equal(converted("fast", { factor: 2, offset: 0 }), "fast");
});

test("a binary frame is an image with its signal, age and type", () => {
  const type = "image/png";
  const data = new ArrayBuffer(20 + type.length + 2);
  const view = new DataView(data);
  view.setUint8(0, 1);
  view.setUint8(1, type.length);
  view.setUint16(2, 513);
  view.setUint32(4, 40);
  view.setFloat64(8, 1000);
  view.setUint32(16, 70000);
  new Uint8Array(data).set([...type].map((letter) => letter.charCodeAt(0)), 20);
  new Uint8Array(data).set([7, 8], 20 + type.length);
  const frame = frameOf(data);
  assert.deepEqual([frame?.index, frame?.ageMs, frame?.sentMs, frame?.number, frame?.type], [513, 40, 1000, 70000, type]);
  assert.deepEqual([...(frame?.bytes ?? [])], [7, 8]);
  for (const size of [0, 15, 20]) assert.equal(frameOf(data.slice(0, size)), null);
  assert.equal(frame?.isRepeated, undefined);
  view.setUint8(0, 3);
  assert.deepEqual([frameOf(data)?.isRepeated, frameOf(data)?.number, frameOf(data)?.type], [true, 70000, type]);
  view.setUint8(0, 2);
  assert.equal(frameOf(data), null);
});

test("an image has an age like every value, and goes with it", () => {
  const store = storeOf({ type: "image", stale_after_s: 1 });
  store.picture({ index: 0, ageMs: 500, sentMs: 0, number: 3, type: "image/png", bytes: new Uint8Array(9) }, 0);
  const fresh = store.reading("s0", 0);
  assert.deepEqual([fresh.state, fresh.value, fresh.image?.blob.size], ["live", { bytes: 9 }, 9]);
  assert.equal(store.reading("s0", 600).state, "stale");
  assert.deepEqual([store.reading("s0", 60_000).state, store.reading("s0", 60_000).image], ["gone", null]);
});

test("the last values of a lost link stay, with their ages, for as long as it is lost", () => {
  const store = storeOf({ type: "image", stale_after_s: 1 }, { stale_after_s: 1 });
  store.setUp(true, 0);
  const link = (/** @type {string} */ state, /** @type {number} */ nowMs) =>
    store.setLinks(/** @type {any} */ ([{ transport: "wire", state, since: 0 }]), nowMs);
  link("live", 0);
  store.picture({ index: 0, ageMs: 0, sentMs: 0, number: 4, type: "image/png", bytes: new Uint8Array(9) }, 0);
  assert.equal(store.lastAgeMs("s0", 500), -1, "a live value is not the last one");
  link("lost", 500);
  assert.equal(store.reading("s0", 501).state, "stale", "at once");
  const hourMs = 3_600_000;
  const late = store.reading("s0", hourMs);
  assert.deepEqual([late.state, late.age, late.image?.blob.size], ["stale", "1 h", 9]);
  assert.equal(store.lastAgeMs("s0", hourMs), hourMs);
  assert.equal(store.lastAgeMs("s1", hourMs), -1, "nothing was received");
  link("live", hourMs);
  assert.equal(store.reading("s0", hourMs).state, "gone", "a link that is back has newer values");
  link("lost", hourMs);
  assert.equal(store.reading("s0", hourMs + 1).state, "gone", "too old before the loss");
});

test("without the server, the last values stay too", () => {
  const store = storeOf({ stale_after_s: 1 });
  store.setUp(true, 0);
  store.setLinks(/** @type {any} */ ([{ transport: "wire", state: "live", since: 0 }]), 0);
  store.values(/** @type {any} */ ({ n: 0, i: [0], v: [7], a: 0 }), 0);
  store.setUp(false, 400);
  const late = store.reading("s0", 90_000);
  assert.deepEqual([late.state, late.value, late.age, store.lastAgeMs("s0", 90_000)], ["stale", 7, "1 min", 90_000]);
});

test("the kit writes numbers for people, and never takes none for zero", () => {
  assert.equal(format(12.3456, 2), "12.35");
  assert.equal(format(-0.001, 1), "0.0");
  assert.equal(format(123456.789), "123457");
  for (const none of [null, undefined, NaN, Infinity, "3", true]) assert.equal(format(none), DASH);
  const reading = storeOf({}).reading("s0", 0);
  assert.deepEqual([number(reading), numbers(reading), many(reading)], [null, null, []]);
  assert.deepEqual(numbers({ ...reading, value: [1, null, NaN] }), [1, null, null]);
  assert.equal(clamp(5, 0, 3), 3);
  assert.equal(t("{n} of {m}", { n: 1 }), "1 of {m}");
});
