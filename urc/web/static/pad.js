// @ts-check
/**
 * Gamepads: a stick moves something only while a shoulder button beside it is held down.
 *
 * A press counts when the stick was at rest in that moment; one that vanishes lets go.
 *
 * @typedef {import("./types.js").HoldSpec} HoldSpec
 * @typedef {import("./types.js").Hand} Hand
 *
 * @typedef {object} Held The part of a grip that a pad needs.
 * @property {HoldSpec} spec
 * @property {Hand | null} hand
 * @property {(hand: Hand) => void} begin
 * @property {(kinds: Hand["kind"][]) => void} drop
 */

/** Beyond it a stick is not at rest. */
const REST = 0.05;
/** Where the sticks and shoulder buttons are, on a pad that the browser knows ("standard"). */
const SIDES = {
  left: { x: 0, y: 1, buttons: [4, 6] },
  right: { x: 2, y: 3, buttons: [5, 7] },
};

export class Pads {
  /** @param {() => void} run starts the sampling */
  constructor(run) {
    this.isConnected = false;
    /** Sides whose shoulder button was up since the last press. @type {Set<string>} */
    this.ready = new Set();
    addEventListener("gamepadconnected", () => {
      this.isConnected = true;
      this.ready.clear();
      run();
    });
    addEventListener("gamepaddisconnected", () => {
      this.isConnected = this.pad() !== null;
      this.ready.clear();
    });
  }

  /** @returns {Gamepad | null} the first that has the usual layout */
  pad() {
    const found = navigator.getGamepads?.() ?? [];
    return found.find((pad) => pad?.connected && pad.mapping === "standard") ?? null;
  }

  /** @param {Iterable<Held>} grips */
  step(grips) {
    if (!this.isConnected) return;
    const pad = this.pad();
    for (const grip of grips) {
      const side = grip.spec.pad;
      if (!side) continue;
      if (!pad) {
        grip.drop(["pad"]);
        continue;
      }
      const { x: xAt, y: yAt, buttons } = SIDES[side];
      const axes = /** @type {[number, number]} */ ([pad.axes[xAt] ?? 0, pad.axes[yAt] ?? 0]);
      const isPressed = buttons.some((place) => pad.buttons[place]?.pressed);
      if (!isPressed) {
        grip.drop(["pad"]);
        this.ready.add(side);
      } else if (grip.hand?.kind === "pad") {
        grip.hand.axes = axes;
      } else if (!grip.hand && this.ready.has(side) && Math.hypot(...axes) <= REST) {
        this.ready.delete(side);
        grip.begin({ kind: "pad", x: 0, y: 0, startX: 0, startY: 0, keys: new Set(), axes });
      } else {
        this.ready.delete(side); // off its centre: let the button go, and press it again
      }
    }
  }
}
