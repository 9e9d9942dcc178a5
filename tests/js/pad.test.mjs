// @ts-check
/** Which press of a gamepad holds something, and what makes it let go. */
import assert from "node:assert/strict";
import test from "node:test";

/** @type {(() => void)[]} */
const plugged = [];
Object.assign(globalThis, {
  addEventListener(/** @type {string} */ name, /** @type {() => void} */ listener) {
    if (name === "gamepadconnected") plugged.push(listener);
  },
  localStorage: { getItem: () => null, setItem() {}, removeItem() {} },
});
const { Gamepads } = await import("../../urc/web/static/control/gamepad.js");
const { STANDARD, withAxis } = await import("../../urc/web/static/widgets/gamepad_map.js");

const ENABLE = STANDARD.left[0] ?? 0;

/** A pad, a grip that its left stick moves, and one frame of the page. */
function played() {
  const pad = {
    id: "Pad", index: 0, connected: true, mapping: "standard", timestamp: 1,
    axes: [0, 0, 0, 0], buttons: Array.from({ length: 16 }, () => ({ pressed: false })),
  };
  Object.defineProperty(globalThis, "navigator", { value: { getGamepads: () => [pad] }, configurable: true });
  const pads = new Gamepads(() => {});
  plugged.at(-1)?.();
  const grip = {
    spec: { pad: "left" },
    /** @type {any} */
    hand: null,
    newHand: (/** @type {string} */ kind) => ({ kind }),
    begin: (/** @type {any} */ hand) => (grip.hand = hand),
    drop: () => (grip.hand = null),
  };
  const frame = () => {
    pad.timestamp += 1;
    pads.step(/** @type {any} */ ([grip]), pad.timestamp);
  };
  const press = (/** @type {boolean} */ isDown) => {
    const button = pad.buttons[ENABLE];
    if (button) button.pressed = isDown;
    frame();
  };
  frame(); // in which the pad is met
  return { pad, pads, grip, frame, press };
}

test("a stick that is learnt anew while it is held moves nothing before a new press", () => {
  const { pad, pads, grip, frame, press } = played();
  press(false);
  press(true);
  pad.axes = [0, 0.5, 0, -1];
  frame();
  assert.deepEqual(grip.hand.axes, [0, 0.5]);
  pads.setMap("Pad", withAxis(STANDARD, 1, 3, false));
  frame();
  assert.equal(grip.hand, null, "what the stick means has changed under the hand");
  frame();
  assert.equal(grip.hand, null);
  pad.axes = [0, 0, 0, 0];
  press(false);
  press(true);
  pad.axes = [0, 0, 0, -1];
  frame();
  assert.deepEqual(grip.hand.axes, [0, -1]);
});
