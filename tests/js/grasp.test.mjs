// One pointer that has hold of an element: `node --import ./tests/js/page.mjs tests/js/grasp.test.mjs`.
import assert from "node:assert/strict";
import { test } from "node:test";
import { grasp } from "urc/command_kit";

/** An element that gets the events of pointers, as far as `grasp` looks at them. */
class Element extends EventTarget {
  captured = [];

  setPointerCapture(pointerId) {
    this.captured.push(pointerId);
  }

  /** @returns {boolean} whether the browser may do with it what it does otherwise */
  get(type, pointerId = 1, more = {}) {
    const event = new Event(type, { cancelable: true });
    const known = Object.entries({ pointerId, button: 0, buttons: 1, ...more });
    for (const [name, value] of known) Object.defineProperty(event, name, { value });
    return this.dispatchEvent(event);
  }
}

/** Take hold of a new element; `said` is what was told. */
function held({ takes = true, ...more } = {}) {
  const el = new Element();
  const said = [];
  const end = new AbortController();
  const hold = grasp(el, {
    take: () => (said.push("take"), takes),
    move: () => said.push("move"),
    release: () => said.push("release"),
    cancel: () => said.push("cancel"),
    signal: end.signal,
    ...more,
  });
  return { el, said, hold, end };
}

// The page, whose events break off what is drawn.
const page = new EventTarget();
globalThis.addEventListener = page.addEventListener.bind(page);

test("a pointer takes hold, moves and is let go", () => {
  const { el, said } = held();
  for (const type of ["pointerdown", "pointermove", "pointerup", "lostpointercapture"]) el.get(type);
  assert.deepEqual(said, ["take", "move", "release"]);
  assert.deepEqual(el.captured, [1]);
});

test("the main button of a mouse comes up while another is down: no event but a move says so", () => {
  const { el, said } = held();
  el.get("pointerdown");
  el.get("pointermove", 1, { buttons: 5 });
  el.get("pointermove", 1, { buttons: 4 });
  el.get("pointermove", 1, { buttons: 4 });
  el.get("pointerup", 1, { buttons: 0 });
  assert.deepEqual(said, ["take", "move", "release"]);
});

test("a second pointer means nothing while the first one holds", () => {
  const { el, said } = held();
  el.get("pointerdown", 1);
  for (const type of ["pointerdown", "pointermove", "pointerup"]) el.get(type, 2);
  assert.deepEqual(said, ["take"]);
  el.get("pointerup", 1);
  assert.deepEqual(said, ["take", "release"]);
});

test("what is refused is not held", () => {
  const { el, said } = held({ takes: false });
  el.get("pointerdown");
  el.get("pointermove");
  assert.deepEqual(said, ["take"]);
  assert.deepEqual(el.captured, []);
});

test("another button of a mouse takes no hold", () => {
  const { el, said } = held();
  el.get("pointerdown", 1, { button: 2 });
  assert.deepEqual(said, []);
});

test("a pointer that is taken away is told once", () => {
  const { el, said, hold } = held();
  el.get("pointerdown");
  el.get("pointercancel");
  el.get("lostpointercapture");
  hold.drop();
  assert.deepEqual(said, ["take", "cancel"]);
});

test("it can be taken away, and taken hold of again", () => {
  const { el, said, hold } = held();
  el.get("pointerdown", 1);
  hold.drop();
  el.get("pointermove", 1);
  el.get("pointerdown", 2);
  assert.deepEqual(said, ["take", "cancel", "take"]);
});

test("nothing is heard after the end", () => {
  const { el, said, end } = held();
  end.abort();
  el.get("pointerdown");
  assert.deepEqual(said, []);
});

test("what is drawn is lost with the page's focus, and a touch begins nothing else", () => {
  const { el, said } = held({ isDrawing: true });
  el.get("pointerdown");
  page.dispatchEvent(new Event("blur"));
  assert.deepEqual(said, ["take", "cancel"]);
  assert.equal(el.get("touchstart"), false);
});

test("what is not drawn stays held while the page loses its focus", () => {
  const { el, said } = held();
  el.get("pointerdown");
  page.dispatchEvent(new Event("blur"));
  assert.deepEqual(said, ["take"]);
  assert.equal(el.get("touchstart"), true);
});

/** A slide that a finger draws sideways, or a dial, with a finger on it. */
function touched(way = "x") {
  const made = held({ way });
  const finger = (type, clientX = 0, clientY = 0, atMs = 0) => {
    made.el.get(type, 1, { pointerType: "touch", clientX, clientY, timeStamp: atMs });
  };
  finger("pointerdown");
  return { ...made, finger };
}

test("a finger takes hold by a tap", () => {
  const { said, finger } = touched();
  finger("pointermove", 3, 3);
  assert.deepEqual(said, []);
  finger("pointerup", 3, 3);
  assert.deepEqual(said, ["take", "release"]);
});

test("a finger takes hold when it draws that way, and goes on any way", () => {
  const { el, said, finger } = touched();
  assert.equal(el.get("touchmove"), true);
  finger("pointermove", 20, 5);
  finger("pointermove", 20, 80);
  assert.equal(el.get("touchmove"), false, "the page stays where it is");
  finger("pointerup", 20, 80);
  assert.deepEqual(said, ["take", "move", "release"]);
});

test("a finger that goes another way, or is taken away, sets nothing", () => {
  for (const type of ["pointermove", "pointercancel"]) {
    const { said, finger } = touched();
    finger(type, 5, 20);
    finger("pointermove", 80, 20);
    finger("pointerup", 80, 20);
    assert.deepEqual(said, []);
  }
});

test("an upright slide is drawn up and down", () => {
  const { said, finger } = touched("y");
  finger("pointermove", 5, 20);
  assert.deepEqual(said, ["take"]);
});

test("a finger that has rested on a dial draws it any way", () => {
  for (const [atMs, taken] of [[100, []], [500, ["take"]]]) {
    const { said, finger } = touched("round");
    finger("pointermove", 5, 20, atMs);
    assert.deepEqual(said, taken);
  }
});

test("a mouse takes hold at once, whatever a finger may do there", () => {
  const { el, said } = held({ way: "x" });
  el.get("pointerdown", 1, { pointerType: "mouse" });
  assert.deepEqual(said, ["take"]);
});

test("a part that loses the pointer to the whole takes nothing away", () => {
  const { el, said } = held();
  el.get("pointerdown");
  el.get("lostpointercapture", 1, { target: new Element() });
  assert.deepEqual(said, ["take"]);
});
