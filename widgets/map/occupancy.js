// @ts-check
/**
 * Occupancy grids under the map: free, occupied and unknown cells, and costmaps above them.
 *
 * Free cells are plain and occupied cells have the colour of text. Unknown cells of the map are
 * hatched, so the three differ by shape too. Only the newest image of a grid is decoded.
 */
/** @typedef {import("leaflet").Map} LeafletMap */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/core/types.js").Picture} Picture */
/** @typedef {import("./grid_image.js").GridPlace} GridPlace */
import { between, cornersOf, partsOf, placeOfGrid, recoloured } from "./grid_image.js";

/** Distance between the lines of the hatching in pixels. */
const HATCH = 10;
/** Cells below this size in pixels are smoothed, because some would vanish. */
const SMOOTH_BELOW = 1;
/** Occupancy of cells that a robot cannot enter: 99 is inscribed, 100 is lethal (costmap_2d). */
const LETHAL = 99;

/**
 * @typedef {Record<"raised" | "faint" | "text" | "series-3", string>} Inks
 */

class Layer {
  /**
   * @param {boolean} isMap whether the grid is the map; else it is a costmap
   * @param {() => void} changed
   */
  constructor(isMap, changed) {
    this.isMap = isMap;
    this.changed = changed;
    /** Newest picture. @type {Picture | null} */
    this.next = null;
    this.serial = 0;
    this.isBusy = false;
    this.isOver = false;
    /** @type {ImageBitmap | null} */
    this.bitmap = null;
    /** @type {GridPlace | null} */
    this.place = null;
    /** Whether the newest picture is no grid. */
    this.isBad = false;
    this.isOld = false;
    /** @type {Inks | null} */
    this.inks = null;
  }

  /** @param {Reading} reading */
  take(reading) {
    const isOld = reading.state !== "live";
    if (isOld !== this.isOld) {
      this.isOld = isOld;
      this.changed();
    }
    if (!reading.image) {
      this.serial = 0;
      this.next = null;
      this.drop();
      return;
    }
    if (reading.image.serial === this.serial) return;
    this.serial = reading.image.serial;
    this.next = reading.image;
    void this.work();
  }

  /** @param {Inks} inks */
  theme(inks) {
    this.inks = inks;
    void this.work();
  }

  /** Decode the newest picture in the colours of the theme; a newer one waits for its turn. */
  async work() {
    if (this.isBusy) return;
    this.isBusy = true;
    let [seen, inks] = [/** @type {Picture | null} */ (null), /** @type {Inks | null} */ (null)];
    while (!this.isOver && this.next && this.inks && (seen !== this.next || inks !== this.inks)) {
      [seen, inks] = [this.next, this.inks];
      await this.show(seen, inks);
    }
    this.isBusy = false;
  }

  /**
   * @param {Picture} picture
   * @param {Inks} inks
   */
  async show(picture, inks) {
    try {
      const image = new Uint8Array(await picture.blob.arrayBuffer());
      const place = placeOfGrid(image);
      if (!place) throw new Error("no occupancy grid");
      const parts = recoloured(image, this.isMap ? mapColours(inks) : costColours(inks));
      const bitmap = await createImageBitmap(new Blob(parts, { type: "image/png" }));
      if (this.isOver || !this.next) {
        bitmap.close();
        return;
      }
      this.bitmap?.close();
      [this.bitmap, this.place, this.isBad] = [bitmap, place, false];
    } catch {
      this.drop();
      this.isBad = true;
    }
    this.changed();
  }

  drop() {
    if (this.bitmap || this.isBad) this.changed();
    this.bitmap?.close();
    [this.bitmap, this.place, this.isBad] = [null, null, false];
  }

  end() {
    this.isOver = true;
    this.bitmap?.close();
    this.bitmap = null;
  }
}

export class Occupancy {
  /** @param {() => void} changed called when the grids must be drawn again */
  constructor(changed) {
    this.changed = changed;
    /** @type {Layer[]} */
    this.layers = [];
    /** @type {Inks | null} */
    this.inks = null;
  }

  /** @param {readonly Reading[]} readings the map, then the costmaps */
  update(readings) {
    readings.forEach((reading, place) => {
      let layer = this.layers[place];
      if (!layer) {
        layer = this.layers[place] = new Layer(place === 0, () => this.changed());
        if (this.inks) layer.theme(this.inks);
      }
      layer.take(reading);
    });
  }

  /** @param {Inks} inks */
  theme(inks) {
    this.inks = inks;
    for (const layer of this.layers) layer.theme(inks);
  }

  /** Return whether the newest picture of a grid is no grid. @param {number} place */
  isBad(place) {
    return this.layers[place]?.isBad ?? false;
  }

  /** The place of the map; null before its first picture. */
  get place() {
    return this.layers[0]?.place ?? null;
  }

  /**
   * Draw all grids on a context with CSS pixels.
   *
   * @param {CanvasRenderingContext2D} pen
   * @param {LeafletMap} map
   */
  paint(pen, map) {
    const [zero, one] = [map.latLngToContainerPoint([0, 0]), map.latLngToContainerPoint([0, 1])];
    const perMetre = one.x - zero.x;
    for (const { bitmap, place, isMap, isOld } of this.layers) {
      if (!bitmap || !place) continue;
      const cell = perMetre * place.resolution;
      const corner = map.latLngToContainerPoint([place.y, place.x]);
      if (isMap) this.hatch(pen, place, map);
      pen.save();
      pen.translate(corner.x, corner.y);
      pen.rotate(-place.yaw); // screens count clockwise
      pen.imageSmoothingEnabled = cell < SMOOTH_BELOW;
      pen.globalAlpha = isOld ? 0.5 : 1;
      pen.drawImage(bitmap, 0, -cell * place.height, cell * place.width, cell * place.height);
      pen.restore();
    }
  }

  /**
   * @param {CanvasRenderingContext2D} pen
   * @param {GridPlace} place
   * @param {LeafletMap} map
   */
  hatch(pen, place, map) {
    const { x: width, y: height } = map.getSize();
    pen.save();
    pen.beginPath();
    for (const corner of cornersOf(place)) {
      const { x, y } = map.latLngToContainerPoint(corner);
      pen.lineTo(x, y);
    }
    pen.closePath();
    pen.clip();
    // The lines move with the map, because hatching that stands still hides the motion.
    const { x: left, y: top } = map.latLngToContainerPoint([place.y, place.x]);
    const first = (((left + top) % HATCH) + HATCH) % HATCH;
    pen.beginPath();
    for (let at = first; at < width + height; at += HATCH) {
      pen.moveTo(at, 0);
      pen.lineTo(at - height, height);
    }
    pen.strokeStyle = this.inks?.faint ?? "";
    pen.lineWidth = 1;
    pen.stroke();
    pen.restore();
  }

  end() {
    for (const layer of this.layers) layer.end();
  }
}

/**
 * @param {Inks} inks
 * @returns {(value: number) => import("./grid_image.js").Colour}
 */
function mapColours(inks) {
  const [free, full] = [partsOf(inks.raised), partsOf(inks.text)];
  return (value) => (value < 0 ? [0, 0, 0, 0] : [...between(free, full, value / 100), 255]);
}

/**
 * @param {Inks} inks
 * @returns {(value: number) => import("./grid_image.js").Colour}
 */
function costColours(inks) {
  const cost = partsOf(inks["series-3"]);
  return (value) => [...cost, value <= 0 ? 0 : value >= LETHAL ? 130 : Math.round(10 + value * 0.8)];
}
