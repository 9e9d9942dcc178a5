// @ts-check
/** What a foreign widget's frame may say, and what it is told. */
import assert from "node:assert/strict";
import { test } from "node:test";
import { heard, MOST_MESSAGES, Rate, tellable } from "../../urc/web/static/frame/frame_protocol.js";

const BOUND = {
  command: "go", names: {}, fixed: {}, ranges: {}, neutral: {}, line: "wire", refusal: "",
  leaseMs: 250, isAnswered: true,
};
const OUTPUTS = { press: { ...BOUND, isHeld: false }, moved: { ...BOUND, isHeld: true } };
const say = (/** @type {unknown} */ message) => heard(message, OUTPUTS);

test("what is no message of ours means nothing", () => {
  const wrong = [
    null, undefined, 1, "ready", [], ["ready"], {}, { t: 1 }, { t: "" }, { t: "toString" },
    { t: "run", command: "go" }, { t: "tick", command: "go" }, { t: "release" }, { t: "ws" },
    { t: "__proto__" }, { t: "constructor" },
  ];
  for (const message of wrong) assert.equal(say(message), null, JSON.stringify(message));
});

test("only commands that are bound are given, with plain arguments", () => {
  assert.deepEqual(say({ t: "send", id: 1, output: "press", args: { power: 2 }, more: 1 })?.t, "send");
  for (const output of ["erase", "toString", "__proto__", "", 1, null, ["press"]]) {
    assert.equal(say({ t: "send", id: 1, output, args: {} }), null);
    assert.equal(say({ t: "steer", output, verb: "abort" }), null);
    assert.equal(say({ t: "hold", id: 1, output, keys: [] }), null);
  }
  const many = Object.fromEntries(Array.from({ length: 65 }, (_, place) => [`a${place}`, 1]));
  const bad = [
    null, [], "x", { a: {} }, { a: undefined }, { a: NaN }, { a: Infinity }, { a: () => 1 }, many,
    { a: "x".repeat(20_001) }, { a: Array(10_001).fill(0) }, { a: [[1]] }, { a: [{}] },
  ];
  for (const args of bad) assert.equal(say({ t: "send", id: 1, output: "press", args }), null);
  for (const id of [-0.5, "1", NaN, null, undefined]) {
    assert.equal(say({ t: "send", id, output: "press", args: {} }), null);
  }
});

test("the images that a widget shows are chosen by their places", () => {
  assert.deepEqual(say({ t: "look", input: "images", places: [1] }), { t: "look", input: "images", places: [1] });
  assert.deepEqual(say({ t: "look", input: 5, places: "x" }), { t: "look", input: "", places: [] });
  assert.deepEqual(say({ t: "look", input: "images", places: [-1, "x", 2] })?.places, [0, 0, 2]);
});

test("arguments make no prototype", () => {
  const args = JSON.parse('{"__proto__": 1, "constructor": 2}');
  const message = say({ t: "send", id: 1, output: "press", args });
  assert(message?.t === "send");
  assert.equal(Object.getPrototypeOf(message.args), null);
  assert.deepEqual(Object.keys(message.args), ["__proto__", "constructor"]);
});

test("a command that is not held cannot be held, and no key is taken that leaves or stops", () => {
  assert.equal(say({ t: "hold", id: 1, output: "press", keys: [] }), null);
  const keys = ["ArrowUp", "Escape", "Space", "Tab", 5, "x".repeat(41)];
  const keysOn = [2, -1, "x", 4, 5, 6];
  const message = say({ t: "hold", id: 1, output: "moved", keys, keysOn, taps: keys, pad: "up", stays: 1 });
  assert.deepEqual(message, {
    t: "hold", id: 1, output: "moved", keys: ["ArrowUp"], keysOn: [2, 0, 0, 4], taps: ["ArrowUp"],
    pad: "", stays: false,
  });
});

test("a gate must be held where nothing else is said, and closes in time", () => {
  const message = say({ t: "gate", id: 2, timeoutMs: 1e12, key: "Space", pad: "left" });
  assert.deepEqual(message, { t: "gate", id: 2, isHeld: true, timeoutMs: 600_000, key: "", pad: "left" });
});

test("places have sizes that are numbers, and only some keys of the page", () => {
  const message = say({
    t: "places",
    places: [{ id: 1, box: { x: -5, y: NaN, width: "9", height: 1e9 }, page: "all", label: 5 }, null],
  });
  assert(message?.t === "places");
  assert.deepEqual(message.places[0], {
    id: 1, box: { x: 0, y: 0, width: 0, height: 1e5 }, holes: [], label: "", said: "",
    isFocusable: false, page: "free",
  });
  assert.equal(message.places[1]?.id, 0);
  const many = say({ t: "places", places: Array(1000).fill({}) });
  assert(many?.t === "places" && many.places.length === 16);
});

test("people's wishes that are not a widget's are dropped", () => {
  const wishes = ["take", "ask", "leave", "force", "yes", "no", "reset", "toString"];
  const heardOf = wishes.filter((wish) => say({ t: "drive", wish }));
  assert.deepEqual(heardOf, ["take", "ask", "leave"]);
});

test("a widget is told of what it is bound to, without addresses", () => {
  const bound = { signals: new Set(["a"]), commands: new Set(["go"]) };
  const link = { transport: "wire", state: "live", address: "tcp 10.0.0.1:22", detail: "root@x" };
  assert.deepEqual(tellable("links", { isUp: true, links: [link] }, bound), {
    isUp: true, isRefused: false, isReplay: false, links: [{ transport: "wire", state: "live", address: "", detail: "" }],
  });
  const alarms = [{ signal: "a" }, { signal: "b" }];
  assert.deepEqual(tellable("alarms", alarms, bound), [{ signal: "a" }]);
  assert.deepEqual(tellable("sequences", { go: 1, erase: 2 }, bound), { go: 1 });
  assert.equal(say({ t: "follow", what: "log" }), null);
  assert.equal(say({ t: "follow", what: "toString" }), null);
});

test("a flood is counted by the second", () => {
  const rate = new Rate(MOST_MESSAGES);
  const within = Array.from({ length: 1500 }, () => rate.take(5)).filter(Boolean).length;
  assert.equal(within, 1000);
  assert.equal(rate.take(1004), false);
  assert.equal(rate.take(1005), true);
});

test("what is kept is a text of a size", () => {
  assert.deepEqual(say({ t: "memory", text: "[1]" }), { t: "memory", text: "[1]" });
  for (const text of [null, 1, {}, "x".repeat(20_001)]) assert.equal(say({ t: "memory", text }), null);
});
