// @ts-check
/** Who hears of STOP: at once, also on a page that draws nothing, and when it is reset already. */
import assert from "node:assert/strict";
import test from "node:test";

Object.assign(globalThis, { addEventListener() {}, window: globalThis });
const { StopButton } = await import("../../urc/web/static/control/stop.js");
const { CommandState } = await import("../../urc/web/static/widgets/command_state.js");

/** A button of which it can be said what is known of STOP. */
function scene() {
  const drive = { isLatched: false, isConfirmed: false, phase: "", lease: { latched: "" }, stop() {} };
  const input = { spendAll() {}, isDriving: () => false };
  const store = { isUp: true, links: new Map() };
  const stop = new StopButton(/** @type {any} */ (drive), /** @type {any} */ (input), /** @type {any} */ (store), [], false);
  /** @type {string[]} */
  const heard = [];
  stop.follow(({ phase }) => void heard.push(phase));
  return { drive, stop, heard };
}

test("a stop of somebody else is heard without a frame", () => {
  const { drive, stop, heard } = scene();
  drive.isLatched = true;
  stop.heard();
  assert.deepEqual(heard, ["", "latched"]);
});

test("one that is reset already is heard as well", () => {
  const { stop, heard } = scene();
  stop.heard();
  assert.deepEqual(heard, ["", "latched", ""]);
});

test("what waits to be given is forgotten then, and questions are", async () => {
  const { stop } = scene();
  let forgotten = 0;
  stop.onPressed = () => void (forgotten += 1);
  /** @type {unknown[]} */
  const given = [];
  let answer = () => {};
  const give = (/** @type {unknown} */ args) => {
    given.push(args);
    return new Promise((resolve) => (answer = () => resolve(undefined)));
  };
  const giver = new CommandState({
    give,
    show() {},
    t: (/** @type {string} */ text) => text,
    signal: new AbortController().signal,
    everyMs: 0,
    onStop: (listener) => stop.follow(listener),
  });
  giver.take({ isReady: true, reason: "", isAnswered: true });
  giver.newest({ value: 1 });
  giver.newest({ value: 2 });
  stop.heard();
  answer();
  await new Promise(setImmediate);
  giver.become("");
  assert.deepEqual([given, forgotten], [[{ value: 1 }], 1]);
});

test("STOP is sent even if a widget throws an exception", () => {
  const { drive, stop } = scene();
  let sent = 0;
  drive.stop = () => void (sent += 1);
  stop.input.spendAll = () => {
    throw new Error("a bug of a widget");
  };
  assert.throws(() => stop.press());
  assert.equal(sent, 1);
});

test("Escape is STOP first while a robot moves by itself, and otherwise answers no", () => {
  const { drive, stop } = scene();
  let sent = 0;
  drive.stop = () => void (sent += 1);
  let isMapMoving = false;
  const found = () => (isMapMoving ? {} : null);
  Object.assign(globalThis, { document: { querySelector: found } });
  const press = () => {
    let isPassed = true;
    const keep = () => void (isPassed = false);
    stop.escape(/** @type {any} */ ({ key: "Escape", repeat: false, preventDefault() {}, stopImmediatePropagation: keep }));
    return isPassed;
  };
  assert.deepEqual([press(), sent], [true, 0]);
  stop.moving = ["goto"];
  assert.deepEqual([press(), sent], [false, 1]);
  stop.moving = [];
  isMapMoving = true; // a widget knows of a motion whose command is lost
  assert.deepEqual([press(), sent], [false, 2]);
});
