// @ts-check
/**
 * Gamepads. A stick has an effect only while the shoulder button on its side is held.
 *
 * A press of that button counts only if all sticks without a held control were at rest. A gamepad
 * that disappears, is replaced, or sends unchanged deflections for too long releases its controls.
 * Plugging in a gamepad enables nothing. Browsers know the layout of some gamepads ("standard");
 * others need a mapping stored on this device.
 *
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 * @typedef {import("../core/types.js").Hand} Hand
 * @typedef {import("../core/types.js").PadView} PadView
 * @typedef {import("../widgets/gamepad_map.js").PadMap} PadMap
 *
 * @typedef {object} Held The interface of a held control for gamepads.
 * @property {HoldSpec} spec
 * @property {Hand | null} hand
 * @property {(kind: Hand["kind"]) => Hand} newHand
 * @property {(hand: Hand) => void} begin
 * @property {(kinds: Hand["kind"][]) => void} drop
 */
import { STANDARD, parsed, sticksOf } from "../widgets/gamepad_map.js";

/** Deflection below which a stick is at rest. */
const REST = 0.05;
/** Time after which an unchanged deflection counts as a frozen link. */
const FROZEN_MS = 2000;
const STORED = "urc-pad:";
/** Indexes of each side's stick in the result of `sticksOf`. */
const PLACES = { left: [0, 1], right: [2, 3] };

export class Gamepads {
  /** @param {() => void} run starts the sampling */
  constructor(run) {
    this.isConnected = false;
    /** Sides whose shoulder button was up since their last press. @type {Set<string>} */
    this.ready = new Set();
    /** Gamepad in use, by index and name. */
    this.used = "";
    this.stamp = 0;
    this.stampMs = 0;
    /** Held buttons for speed steps. @type {Set<string>} */
    this.down = new Set();
    /** Mapping by device name. @type {Map<string, PadMap | null>} */
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

  /** @returns {Gamepad | null} the first gamepad with a known layout */
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
   * Store the mapping of a device; null restores the browser's layout. Held controls are released,
   * because the mapping changes the meaning of deflections.
   *
   * @param {string} id
   * @param {PadMap | null} map
   */
  setMap(id, map) {
    this.maps.set(id, map);
    this.used = ""; // treated as a new device
    try {
      if (map) localStorage.setItem(STORED + id, JSON.stringify(map));
      else localStorage.removeItem(STORED + id);
    } catch (error) {
      console.warn("URC: the mapping lasts until the page is left:", error);
    }
  }

  /** @returns {PadView[]} the state of each gamepad, for display */
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
   * @param {ReadonlySet<string>} ready sides on which a hold may begin in this frame
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
    this.ready.delete(side); // each press counts once; off-centre, press again
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
    if (timestamp === undefined) return false; // a freeze cannot be detected without timestamps
    if (timestamp !== this.stamp) {
      this.stamp = timestamp;
      this.stampMs = nowMs;
    }
    return nowMs - this.stampMs > FROZEN_MS;
  }
}

/**
 * Whether a press may count, because all sticks without a held control are at rest.
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
    return null; // no storage: use the browser's layout
  }
}
