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
   */
  constructor(map, signal, aimed) {
    this.map = map;
    this.aimed = aimed;
    this.isOn = false;
    /** Pointer of the running gesture. */
    this.pointer = -1;
    /** @type {Place} */
    this.place = [0, 0];
    this.start = { x: 0, y: 0 };
    const area = map.getContainer();
    area.addEventListener("pointerdown", (event) => this.begin(event), { signal, capture: true });
    area.addEventListener("pointermove", (event) => this.move(event), { signal });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      area.addEventListener(end, () => { this.pointer = -1; }, { signal });
    }
  }

  /** @param {boolean} isOn whether a press aims instead of moving the map */
  set(isOn) {
    if (isOn === this.isOn) return;
    this.isOn = isOn;
    this.pointer = -1;
    if (isOn) this.map.dragging.disable();
    else this.map.dragging.enable();
  }

  /** @param {PointerEvent} event */
  begin(event) {
    if (!this.isOn || this.pointer !== -1 || event.button > 0) return;
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
  move(event) {
    if (event.pointerId !== this.pointer) return;
    const [right, down] = [event.clientX - this.start.x, event.clientY - this.start.y];
    if (Math.hypot(right, down) >= FAR) this.aimed(this.place, Math.atan2(-down, right));
  }
}
