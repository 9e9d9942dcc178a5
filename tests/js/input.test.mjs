// @ts-check
/** When what a hand does goes out: with each of its moves, and not more often than helps anybody. */
import assert from "node:assert/strict";
import test from "node:test";

let nowMs = 1000;
/** A page of which nothing is heard. */
const silent = { addEventListener() {} };
Object.assign(globalThis, {
  addEventListener() {},
  document: silent,
  screen: { orientation: silent },
  requestAnimationFrame() {},
});
performance.now = () => nowMs;
const { Input } = await import("../../urc/web/static/control/input.js");
const { Control } = await import("../../urc/web/static/control/held_control.js");

/** A control that a hand holds, and what was told of it. */
function held() {
  /** @type {number[]} */
  const told = [];
  const drive = {
    lease: { epoch: 1 },
    isMine: true,
    isFree: true,
    beat: 7,
    tell: (/** @type {any} */ tick) => told.push(tick.arguments.x) > 0,
  };
  const input = new Input(/** @type {any} */ (drive));
  const control = Object.assign(new Control("go"), { phase: "held", epoch: 1 });
  const hand = { x: 0 };
  const grip = {
    control,
    output: { neutral: { x: 0 }, leaseMs: 300 },
    spec: {},
    x: 0,
    take: () => (grip.x = hand.x),
    given: () => ({ x: grip.x }),
    check() {},
    show() {},
  };
  control.grips.add(/** @type {any} */ (grip));
  input.controls.set("go", control);
  input.frameMs = nowMs;
  const frame = () => void input.step(nowMs);
  const move = (/** @type {number} */ x) => {
    hand.x = x;
    input.moved(/** @type {any} */ (grip));
  };
  return { told, frame, move, input, control, drive };
}

test("a slow link of another site is named at the control, and so is an old image that is worse", () => {
  const { input, control, drive } = held();
  /** @param {number | null} percent @param {number} [image] */
  const note = (percent, image) => {
    Object.assign(drive, { input: percent === null ? null : { age: 0, percent } });
    input.images.share = () => image ?? 1;
    const [grip] = control.grips;
    Object.assign(grip?.output ?? {}, { sees: image === undefined ? undefined : { signal: "eye" } });
    return input.slowNote(control);
  };
  assert.equal(note(null), "");
  assert.equal(note(100), "");
  assert.equal(note(57), "Slow link: 60 % of the speed");
  assert.equal(note(57, 1), "Slow link: 60 % of the speed");
  assert.equal(note(57, 0.2), "Old image: 20 % of the speed");
  Object.assign(drive, { overrideMs: nowMs + 1000 });
  assert.equal(note(57, 0.2), "Slow link: 60 % of the speed");
  assert.equal(note(57, 0), "Driving without an image");
  Object.assign(control, { phase: "spent" });
  assert.equal(note(57), "");
});

test("a move goes out at once, also right behind the tick of a frame", () => {
  const { told, frame, move } = held();
  frame();
  nowMs += 1;
  move(5);
  assert.deepEqual(told, [0, 5]);
});

test("of a thousand moves a second, one in four milliseconds goes out", () => {
  const { told, move } = held();
  for (let x = 1; x <= 12; x += 1) {
    nowMs += 1;
    move(x);
  }
  assert.deepEqual(told, [1, 5, 9]);
});

test("what was kept back goes out with the frame", () => {
  const { told, frame, move } = held();
  move(1);
  nowMs += 1;
  move(2);
  nowMs += 1;
  frame();
  assert.deepEqual(told, [1, 2]);
});

test("a gesture that still asks for the controls ends with STOP, and does not move when they come", () => {
  const { told, frame, input, control } = held();
  control.phase = "asking";
  input.spendAll("STOP");
  frame();
  assert.deepEqual([told, control.phase, control.reason], [[], "spent", "STOP"]);
  input.spendAll("another");
  assert.equal(control.reason, "STOP", "what ended it first is why");
});

test("while STOP is latched, no other reason is shown, whichever is heard first", () => {
  const { input, control } = held();
  const drive = /** @type {any} */ (input.drive);
  const latch = () => Object.assign(drive, { isLatched: true, lease: { epoch: 2, latched: "ann", drives: true, holder: null } });
  input.release = () => {};
  input.stopped("go", "Link to URC too slow for this control");
  assert.equal(control.reason, "Link to URC too slow for this control");
  latch();
  input.leaseChanged();
  assert.equal(control.reason, "Reset STOP first.");
  input.stopped("go", "Link to URC too slow for this control");
  assert.equal(control.reason, "Reset STOP first.");
  Object.assign(drive, { isLatched: false, lease: { epoch: 3, latched: "", drives: true, holder: null } });
  control.grips.clear();
  input.leaseChanged();
  assert.equal(control.phase, "idle");
});

test("while a dead-man does not stand, nothing can be driven", () => {
  const free = { epoch: 1, latched: "", drives: true, holder: null };
  const input = new Input(/** @type {any} */ ({ lease: free, isMine: true }));
  assert.equal(input.refusal(), "");
  const cell = /** @type {any} */ ({});
  input.gated.add(cell);
  assert.equal(input.refusal(), "hold the dead-man control first");
  input.gates.add(/** @type {any} */ ({ isOpen: true }));
  assert.equal(input.refusal(), "");
  input.gates.clear(); // it has failed
  assert.equal(input.refusal(), "hold the dead-man control first");
  input.gated.delete(cell); // its interface was left
  assert.equal(input.refusal(), "");
});

test("what is given once is locked on a page that only watches, and what moves as well as STOP and others say", () => {
  /** @param {object | null} lease @param {boolean} isMine */
  const locks = (lease, isMine = false) => {
    const input = new Input(/** @type {any} */ ({ lease, isMine }));
    return [input.hindrance(), input.hindrance(true)];
  };
  const free = { epoch: 1, latched: "", drives: true, holder: null };
  assert.deepEqual(locks(null), ["", "no connection to URC"]);
  assert.deepEqual(locks(free), ["", ""]);
  assert.deepEqual(locks({ ...free, latched: "ann" }), ["", "Reset STOP first."]);
  const taken = { ...free, holder: { id: "s1", name: "bob" } };
  assert.deepEqual(locks(taken), ["", "bob has the controls"]);
  assert.deepEqual(locks(taken, true), ["", ""]);
  const watches = "this page only watches";
  assert.deepEqual(locks({ ...free, drives: false }), [watches, watches]);
});

test("what is held in a part of the page is released, and nothing else", () => {
  const { input } = held();
  const [inside, outside] = [{}, {}];
  const place = /** @type {any} */ ({ contains: (/** @type {object} */ el) => el === inside });
  /** @type {string[]} */
  const dropped = [];
  const grip = (/** @type {string} */ name, /** @type {object} */ el) =>
    /** @type {any} */ ({ spec: { el }, drop: (/** @type {string[]} */ kinds) => dropped.push(`${name} ${kinds}`) });
  const gate = (/** @type {string} */ name, /** @type {object} */ el) =>
    /** @type {any} */ ({ grip: grip(name, el), close: (/** @type {string} */ why) => dropped.push(`${name} ${why}`) });
  input.grips.add(grip("lever", inside));
  input.grips.add(grip("stick", outside));
  input.gates.add(gate("gate", inside));
  input.gates.add(gate("other gate", outside));
  input.letGoIn(place, "closed");
  const any = "pointer,keys,pad,stay";
  assert.deepEqual(dropped, [`lever ${any}`, "gate closed", `gate ${any}`]);
});
