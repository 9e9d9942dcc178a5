// @ts-check
/**
 * Gamepads: a stick moves something only while a shoulder button beside it is held down.
 *
 * A press counts when everything that nobody holds was at rest in that moment. A pad that vanishes,
 * that another takes the place of, or that says nothing new while it pushes lets go; none enables
 * anything by being plugged in. Where its sticks and buttons are, the browser says for those it
 * knows ("standard"); for any other, what a person has stored on this device.
 *
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 * @typedef {import("../core/types.js").Hand} Hand
 * @typedef {import("../core/types.js").PadView} PadView
 * @typedef {import("../widgets/padmap.js").PadMap} PadMap
 *
 * @typedef {object} Held The part of a grip that a pad needs.
 * @property {HoldSpec} spec
 * @property {Hand | null} hand
 * @property {(kind: Hand["kind"]) => Hand} newHand
 * @property {(hand: Hand) => void} begin
 * @property {(kinds: Hand["kind"][]) => void} drop
 */
import { STANDARD, parsed, sticksOf } from "../widgets/padmap.js";

/** Beyond it a stick is not at rest. */
const REST = 0.05;
/** So long a pad that pushes may say the same: one whose line is cut looks like that. */
const FROZEN_MS = 2000;
const STORED = "urc-pad:";
/** Where the sides' sticks are in what `sticksOf` returns. */
const PLACES = { left: [0, 1], right: [2, 3] };

export class Pads {
  /** @param {() => void} run starts the sampling */
  constructor(run) {
    this.isConnected = false;
    /** Sides whose shoulder button was up since the last press. @type {Set<string>} */
    this.ready = new Set();
    /** The one that is used, by place and name. */
    this.used = "";
    this.stamp = 0;
    this.stampMs = 0;
    /** Buttons that are down, of those that step the speed. @type {Set<string>} */
    this.down = new Set();
    /** Name of a device → its mapping. @type {Map<string, PadMap | null>} */
    this.maps = new Map();
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

  /** @returns {Gamepad[]} */
  all() {
    return (navigator.getGamepads?.() ?? []).flatMap((pad) => (pad?.connected ? [pad] : []));
  }

  /** @returns {Gamepad | null} the first whose layout is known */
  pad() {
    return this.all().find((pad) => this.mapOf(pad) !== null) ?? null;
  }

  /**
   * @param {Gamepad} pad
   * @returns {PadMap | null}
   */
  mapOf({ id = "", mapping }) {
    let map = this.maps.get(id);
    if (map === undefined) {
      map = stored(id);
      this.maps.set(id, map);
    }
    return map ?? (mapping === "standard" ? STANDARD : null);
  }

  /**
   * Keep where the sticks and buttons of a device are; null: as the browser says. What is held is
   * let go: the same hand means something else now.
   *
   * @param {string} id
   * @param {PadMap | null} map
   */
  setMap(id, map) {
    this.maps.set(id, map);
    this.used = ""; // it is met anew
    try {
      if (map) localStorage.setItem(STORED + id, JSON.stringify(map));
      else localStorage.removeItem(STORED + id);
    } catch (error) {
      console.warn("URC: the mapping lasts until the page is left:", error);
    }
  }

  /** @returns {PadView[]} what each pad says, for those who show it */
  views() {
    return this.all().map((pad) => ({
      id: pad.id ?? "",
      axes: [...pad.axes],
      buttons: pad.buttons.map(({ pressed }) => pressed),
      map: this.mapOf(pad),
      isStandard: pad.mapping === "standard",
      isUsed: pad === this.pad(),
    }));
  }

  /**
   * @param {Iterable<Held>} grips
   * @param {number} nowMs
   */
  step(grips, nowMs) {
    if (!this.isConnected) return;
    const all = [...grips].filter((grip) => grip.spec.pad);
    const pad = this.pad();
    const map = pad && this.mapOf(pad);
    const name = pad ? `${pad.index} ${pad.id}` : "";
    if (!pad || !map || name !== this.used) {
      this.used = name;
      this.ready.clear();
      for (const grip of all) grip.drop(["pad"]);
      return;
    }
    const sticks = sticksOf(map, pad.axes);
    const isFrozen = this.isFrozen(pad, nowMs) && Math.max(...sticks.map(Math.abs)) > REST;
    if (isFrozen) this.ready.clear();
    this.steps(all, pad, map);
    const ready = new Set(this.ready);
    for (const grip of all) {
      if (isFrozen) grip.drop(["pad"]);
      else this.stepOne(grip, all, pad, map, sticks, ready);
    }
  }

  /**
   * @param {Held} grip
   * @param {Held[]} all
   * @param {Gamepad} pad
   * @param {PadMap} map
   * @param {[number, number, number, number]} sticks
   * @param {ReadonlySet<string>} ready sides that may begin in this frame
   */
  stepOne(grip, all, pad, map, sticks, ready) {
    const side = grip.spec.pad || "left";
    const [across = 0, along = 0] = PLACES[side].map((place) => sticks[place] ?? 0);
    const isPressed = map[side].some((place) => pad.buttons[place]?.pressed);
    if (!isPressed) {
      grip.drop(["pad"]);
      this.ready.add(side);
      return;
    }
    this.ready.delete(side); // a press counts once; off its centre it does not: press it again
    if (grip.hand?.kind === "pad") {
      const buttons = pad.buttons.map(({ pressed }) => pressed);
      Object.assign(grip.hand, { axes: [across, along], sticks, buttons });
    } else if (!grip.hand && ready.has(side) && isAtRest(grip, all, sticks)) {
      grip.begin({ ...grip.newHand("pad"), keys: new Set(), axes: [across, along], sticks });
    }
  }

  /**
   * @param {Held[]} all
   * @param {Gamepad} pad
   * @param {PadMap} map
   */
  steps(all, pad, map) {
    for (const name of /** @type {const} */ (["slower", "faster"])) {
      const isDown = pad.buttons[map[name]]?.pressed ?? false;
      if (isDown && !this.down.has(name)) for (const grip of all) grip.spec.pace?.(name);
      if (isDown) this.down.add(name);
      else this.down.delete(name);
    }
  }

  /**
   * @param {Gamepad} pad
   * @param {number} nowMs
   */
  isFrozen({ timestamp }, nowMs) {
    if (timestamp === undefined) return false; // it says no time: nothing can be told from it
    if (timestamp !== this.stamp) {
      this.stamp = timestamp;
      this.stampMs = nowMs;
    }
    return nowMs - this.stampMs > FROZEN_MS;
  }
}

/**
 * Whether a press may count: no stick is pushed but those that somebody holds already.
 *
 * @param {Held} grip
 * @param {Held[]} all
 * @param {readonly number[]} sticks
 */
function isAtRest(grip, all, sticks) {
  return /** @type {const} */ (["left", "right"]).every((side) => {
    const isHeld = all.some(({ spec, hand }) => spec.pad === side && hand?.kind === "pad");
    if (isHeld && side !== grip.spec.pad) return true;
    return Math.hypot(...PLACES[side].map((place) => sticks[place] ?? 0)) <= REST;
  });
}

/** @param {string} id */
function stored(id) {
  try {
    return parsed(localStorage.getItem(STORED + id));
  } catch {
    return null; // no storage: as the browser says
  }
}
