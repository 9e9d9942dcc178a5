// @ts-check
/** A grid in metres under the map, which shows motion and distances without tiles. */
/** @typedef {import("leaflet").Map} LeafletMap */
/** @typedef {import("./geo.js").Place} Place */
import { colours, part, style, write } from "urc/kit";
import { wholes } from "urc/axis_ticks";
import { distance, distanceText, gridStep, perMetre } from "./geo.js";

/** Width of a map with smaller squares, in pixels. */
const NARROW_PX = 480;
/** Maximum number of lines; no screen shows this many. */
const MOST_LINES = 200;

export class Grid {
  /**
   * @param {LeafletMap} map
   * @param {HTMLElement} scale bar as long as the side of a square
   * @param {boolean} isLocal
   */
  constructor(map, scale, isLocal) {
    this.map = map;
    this.scale = scale;
    this.length = part(scale, ".map-bar-length");
    part(scale, ".map-north").hidden = isLocal; // "up" is no direction of the Earth there
    this.isLocal = isLocal;
    /** @type {Place} */
    this.origin = [0, 0];
    this.canvas = document.createElement("canvas");
    this.canvas.className = "map-grid";
    this.canvas.setAttribute("aria-hidden", "true");
    this.pen = this.canvas.getContext("2d");
    map.getContainer().prepend(this.canvas);
    /** Draws below the lines. @type {((pen: CanvasRenderingContext2D) => void) | null} */
    this.under = null;
    this.isAsked = false;
    this.theme();
    map.on("move zoom resize viewreset", () => this.ask());
    this.ask();
  }

  theme() {
    this.ink = colours(this.map.getContainer(), ["faint", "line"]);
    this.ask();
  }

  /** @param {Place} origin */
  setOrigin(origin) {
    this.origin = origin;
    this.ask();
  }

  /** Redraw once in the next frame, however often the map has moved. */
  ask() {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      if (this.canvas.isConnected) this.draw();
    });
  }

  draw() {
    const { map, isLocal } = this;
    const { x: width, y: height } = map.getSize();
    if (width === 0 || height === 0) return;
    const pen = this.clear(width, height);
    if (!pen) return;
    this.under?.(pen);
    const [one, other] = [map.containerPointToLatLng([0, height / 2]), map.containerPointToLatLng([100, height / 2])];
    const metres = distance([one.lat, one.lng], [other.lat, other.lng], isLocal) / 100;
    const step = gridStep(metres, width < NARROW_PX ? 40 : 64); // the scale bar leaves room for the place
    write(this.length, distanceText(step));
    style(this.scale, "--map-step", `${(step / metres).toFixed(1)}px`);
    const [up, across] = perMetre(this.origin, isLocal);
    pen.strokeStyle = this.ink?.faint ?? "";
    pen.lineWidth = 1;
    const bounds = map.getBounds();
    const [west, south, east, north] = [bounds.getWest(), bounds.getSouth(), bounds.getEast(), bounds.getNorth()];
    this.lines(pen, this.origin[1], across * step, [west, east], (lng) => {
      const { x } = map.latLngToContainerPoint([south, lng]);
      pen.moveTo(x, 0);
      pen.lineTo(x, height);
    });
    this.lines(pen, this.origin[0], up * step, [south, north], (lat) => {
      const { y } = map.latLngToContainerPoint([lat, west]);
      pen.moveTo(0, y);
      pen.lineTo(width, y);
    });
  }

  /**
   * Return the cleared drawing context. `board` is not used: off-screen drawing is only worthwhile for
   * canvases that change rarely, and the grid moves in each frame of a moving robot.
   *
   * @param {number} width in CSS pixels
   * @param {number} height
   */
  clear(width, height) {
    const { canvas, pen } = this;
    const density = Math.min(3, devicePixelRatio || 1);
    const size = [Math.round(width * density), Math.round(height * density)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) [canvas.width = 1, canvas.height = 1] = size;
    pen?.setTransform(density, 0, 0, density, 0, 0);
    pen?.clearRect(0, 0, width, height);
    return pen;
  }

  /**
   * @param {CanvasRenderingContext2D} pen
   * @param {number} from
   * @param {number} step
   * @param {[number, number]} ends
   * @param {(place: number) => void} line
   */
  lines(pen, from, step, [least, most], line) {
    const [first, last] = [Math.ceil((least - from) / step), Math.floor((most - from) / step)];
    if (!(step > 0) || last - first > MOST_LINES) return;
    for (const index of wholes(first, last)) {
      pen.beginPath();
      pen.strokeStyle = (index === 0 ? this.ink?.line : this.ink?.faint) ?? "";
      line(from + index * step);
      pen.stroke();
    }
  }
}
