// @ts-check
/**
 * A place and a direction in one gesture: press on the place, drag in the direction, let go.
 */
/** @typedef {import("leaflet").Map} LeafletMap */
/** @typedef {import("./geo.js").Place} Place */

/** Distance in pixels from which a gesture has a direction. */
const FAR = 14;

export class Aim {
  /**
   * @param {LeafletMap} map
   * @param {AbortSignal} signal
   * @param {(place: Place, yaw: number | null) => void} aimed called during the gesture; the yaw is
   *   null while the gesture has no direction
   * @param {() => void} undone called when a second finger turns the gesture into a move of the map
   */
  constructor(map, signal, aimed, undone) {
    this.map = map;
    this.aimed = aimed;
    this.undone = undone;
    this.isOn = false;
    /** Pointer of the running gesture. */
    this.pointer = -1;
    /** Pointers on the map. @type {Set<number>} */
    this.down = new Set();
    /** @type {Place} */
    this.place = [0, 0];
    this.start = { x: 0, y: 0 };
    const area = map.getContainer();
    area.addEventListener("pointerdown", (event) => this.begin(event), { signal, capture: true });
    area.addEventListener("pointermove", (event) => this.move(event), { signal });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      area.addEventListener(end, (event) => this.lift(/** @type {PointerEvent} */ (event)), { signal });
    }
  }

  /** @param {boolean} isOn whether a press aims instead of moving the map */
  set(isOn) {
    if (isOn === this.isOn) return;
    this.isOn = isOn;
    this.pointer = -1;
    this.down.clear();
    if (isOn) this.map.dragging.disable();
    else this.map.dragging.enable();
  }

  /** @param {PointerEvent} event */
  begin(event) {
    if (!this.isOn || event.button > 0) return;
    this.down.add(event.pointerId);
    if (this.down.size > 1) {
      if (this.pointer !== -1) this.undone();
      this.pointer = -1;
      return;
    }
    this.pointer = event.pointerId;
    const area = this.map.getContainer();
    area.setPointerCapture(event.pointerId);
    const { left, top } = area.getBoundingClientRect();
    const { lat, lng } = this.map.containerPointToLatLng([event.clientX - left, event.clientY - top]);
    this.place = [lat, lng];
    this.start = { x: event.clientX, y: event.clientY };
    this.aimed(this.place, null);
  }

  /** @param {PointerEvent} event */
  lift(event) {
    this.down.delete(event.pointerId);
    if (event.pointerId === this.pointer) this.pointer = -1;
  }

  /** @param {PointerEvent} event */
  move(event) {
    if (event.pointerId !== this.pointer) return;
    const [right, down] = [event.clientX - this.start.x, event.clientY - this.start.y];
    if (Math.hypot(right, down) >= FAR) this.aimed(this.place, Math.atan2(0 - down, right));
  }
}
