// @ts-check
/**
 * The views of a scan as pixels. Each function fills the buffer of an ImageData in one pass over rays or
 * pixels, without new objects, because a slow device has little time per frame. Pure: no DOM.
 *
 * @typedef {object} Ink Colours as pixels.
 * @property {number} wall
 * @property {number} near
 * @property {number} stop
 * @property {number} free
 * @property {number} unknown
 *
 * @typedef {object} Limits Distances in the unit of the scan.
 * @property {number} most distance at the rim
 * @property {number} reach distance from which the way is clear
 * @property {number} near
 * @property {number} stop
 */
import { NO_RAY } from "./fan.js";
import { wallHeight } from "./rays.js";

/**
 * @param {number} distance
 * @param {Limits} limits
 * @param {Ink} ink
 */
export function inkOf(distance, { near, stop }, ink) {
  if (distance <= stop) return ink.stop;
  return distance <= near ? ink.near : ink.wall;
}

/**
 * Draw a dot for each ray around the middle. Near dots are larger, so that colour is not the only cue.
 * Obstacles beyond the rim are faint dots on it.
 *
 * @param {Uint32Array} into
 * @param {number} size
 * @param {Float32Array} distances
 * @param {{right: Float32Array, down: Float32Array}} ways
 * @param {Limits} limits
 * @param {Ink} ink
 */
export function dots(into, size, distances, ways, limits, ink) {
  into.fill(0);
  const centre = (size - 1) / 2;
  const scale = centre / limits.most;
  for (let index = 0; index < distances.length; index += 1) {
    const distance = distances[index] ?? NaN;
    if (!(distance < limits.reach)) continue;
    const isBeyond = distance > limits.most;
    const way = isBeyond ? centre : distance * scale;
    const x = Math.round(centre + (ways.right[index] ?? 0) * way);
    const y = Math.round(centre + (ways.down[index] ?? 0) * way);
    const half = distance <= limits.stop ? 3 : distance <= limits.near ? 2 : 1;
    const pixel = isBeyond ? ink.unknown : inkOf(distance, limits, ink);
    const [left, right] = [Math.max(0, x - half), Math.min(size - 1, x + half)];
    const bottom = Math.min(size - 1, y + half);
    for (let row = Math.max(0, y - half); row <= bottom; row += 1) {
      into.fill(pixel, row * size + left, row * size + right + 1);
    }
  }
}

/**
 * Draw free space up to the next obstacle, and the obstacle as a wall; between two rays the nearest counts.
 *
 * @param {Uint32Array} into
 * @param {Uint16Array} rays ray of each pixel
 * @param {Float32Array} reach distance of each pixel from the middle, in pixels
 * @param {number} size
 * @param {Float32Array} distances
 * @param {Limits} limits
 * @param {Ink} ink
 */
export function chart(into, rays, reach, size, distances, limits, ink) {
  const scale = (size - 1) / 2 / limits.most;
  const rim = (size - 1) / 2;
  for (let place = 0; place < into.length; place += 1) {
    const far = reach[place] ?? 0;
    const ray = rays[place] ?? NO_RAY;
    if (ray === NO_RAY || far > rim) {
      into[place] = 0;
      continue;
    }
    const distance = distances[ray] ?? NaN;
    const wall = distance * scale;
    if (distance !== distance) into[place] = ink.unknown;
    else if (far < wall - 2) into[place] = ink.free;
    else into[place] = far <= wall + 2 && distance < limits.most ? inkOf(distance, limits, ink) : 0;
  }
}

/**
 * Draw the robot's view: a wall in each direction, higher and brighter for shorter distances.
 *
 * @param {Uint32Array} into
 * @param {number} width
 * @param {number} height
 * @param {Uint16Array} rays ray of each column
 * @param {Float32Array} distances
 * @param {Limits} limits
 * @param {Uint32Array} palette
 * @param {number} unknown pixel
 */
export function view(into, width, height, rays, distances, limits, palette, unknown) {
  const close = limits.most / 12;
  const tops = new Uint16Array(width);
  const colours = new Uint32Array(width);
  for (let column = 0; column < width; column += 1) {
    const distance = distances[rays[column] ?? 0] ?? NaN;
    const isKnown = distance === distance;
    const isClear = isKnown && distance >= limits.most; // free space has no wall
    const share = isKnown ? wallHeight(distance, close) : 0.02;
    colours[column] = isClear ? 0 : isKnown ? shade(distance, limits.most, palette) : unknown;
    tops[column] = Math.floor((height * (1 - share)) / 2);
  }
  // Row by row, in the order of the pixels. The lower half mirrors the upper half.
  for (let row = 0; row < height; row += 1) {
    const depth = Math.min(row, height - 1 - row);
    const from = row * width;
    for (let column = 0; column < width; column += 1) {
      into[from + column] = depth >= (tops[column] ?? 0) ? (colours[column] ?? 0) : 0;
    }
  }
}

/**
 * Return the pixels of the arc: their indexes, and their depth within it, 0 to 1.
 *
 * @param {Float32Array} reach distance of each pixel from the middle, in pixels
 * @param {number} size
 */
export function band(reach, size) {
  const outer = ((size - 1) / 2) * ARC.outer;
  const thick = ((size - 1) / 2) * (ARC.outer - ARC.inner);
  const places = Uint32Array.from(reach.keys()).filter((place) => {
    const depth = outer - (reach[place] ?? 0);
    return depth >= 0 && depth <= thick;
  });
  return { places, depths: Float32Array.from(places, (place) => (outer - (reach[place] ?? 0)) / thick) };
}

/**
 * Draw the distances on an arc around a compass: the colour of each direction shows the distance.
 *
 * @param {Uint32Array} into
 * @param {ReturnType<typeof band>} band
 * @param {Uint16Array} rays ray of each pixel
 * @param {Float32Array} distances
 * @param {Limits} limits
 * @param {Uint32Array} palette
 * @param {number} unknown
 */
export function arc(into, { places, depths }, rays, distances, limits, palette, unknown) {
  into.fill(0);
  // Bars are longer for shorter distances, so that brightness is not the only cue.
  const lengths = distances.map((each) => (each === each ? Math.max(0.06, 1 - each / limits.most) : 0.06));
  const colours = Uint32Array.from(distances, (each) => (each === each ? shade(each, limits.most, palette) : unknown));
  for (let index = 0; index < places.length; index += 1) {
    const place = places[index] ?? 0;
    const ray = rays[place] ?? NO_RAY;
    if (ray !== NO_RAY && (depths[index] ?? 1) <= (lengths[ray] ?? 0)) into[place] = colours[ray] ?? 0;
  }
}

/** Radii of the arc, as shares of half the picture. */
export const ARC = Object.freeze({ inner: 0.5, outer: 0.82 });

/**
 * Draw the distances in order, with the first ray at the left. Near distances are low.
 *
 * @param {Uint32Array} into
 * @param {number} width
 * @param {number} height
 * @param {Float32Array} distances
 * @param {Limits} limits
 * @param {Ink} ink
 */
export function graph(into, width, height, distances, limits, ink) {
  into.fill(0);
  const count = distances.length;
  let before = -1;
  for (let column = 0; column < width; column += 1) {
    const [from, to] = [Math.floor((column * count) / width), Math.floor(((column + 1) * count) / width)];
    let least = Infinity;
    for (let index = from; index < Math.max(from + 1, to); index += 1) {
      const distance = distances[index] ?? NaN;
      if (distance < least) least = distance;
    }
    if (least === Infinity) {
      before = -1;
      continue;
    }
    const share = Math.min(1, least / limits.most);
    const row = Math.min(height - 2, Math.round((1 - share) * (height - 2)));
    const [top, bottom] = before < 0 ? [row, row + 1] : [Math.min(row, before), Math.max(row, before) + 1];
    const pixel = inkOf(least, limits, ink);
    for (let y = top; y <= bottom; y += 1) into[y * width + column] = pixel;
    before = row;
  }
}

/**
 * @param {number} distance
 * @param {number} most
 * @param {Uint32Array} palette
 */
function shade(distance, most, palette) {
  const step = 255 - Math.round((255 * distance) / most);
  return palette[step < 0 ? 0 : step > 255 ? 255 : step] ?? 0;
}
