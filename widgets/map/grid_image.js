// @ts-check
/**
 * Images of occupancy grids: their place on the map, and their colours. Pure: no DOM.
 *
 * A grid arrives as an indexed PNG image with one pixel per cell. A palette index is the value of a
 * cell: 0 to 100 is the occupancy in percent, and all other indexes are unknown. The page replaces
 * the palette by the colours of its theme, so the browser's own decoder does the rest. See
 * `urc/protocol/values/occupancy_grid.py`.
 *
 * @typedef {object} GridPlace
 * @property {number} width number of cells along the grid's x axis
 * @property {number} height
 * @property {number} resolution side of a cell in metres
 * @property {number} x corner of the first cell, in metres
 * @property {number} y
 * @property {number} yaw direction of the grid's x axis in radians, counter-clockwise
 * @property {string} frame
 *
 * @typedef {[number, number, number, number]} Colour red, green, blue and opacity, each 0 to 255
 */

const MAGIC = [0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a];
const KEYWORD = "urc occupancy grid";
/** Maximum number of cells along a side. The server refuses larger grids. */
const MOST = 8192;
const COLOURS = 256;
const FULL = 100;

/**
 * Return the place of a grid, or null if the image is no grid.
 *
 * @param {Uint8Array} image
 * @returns {GridPlace | null}
 */
export function placeOfGrid(image) {
  const head = chunkOf(image, "IHDR");
  const text = chunkOf(image, "tEXt");
  if (!head || !text || head.length < 13) return null;
  const letters = new TextDecoder("latin1").decode(text);
  const end = letters.indexOf("\0");
  if (letters.slice(0, end) !== KEYWORD) return null;
  const view = new DataView(head.buffer, head.byteOffset);
  const [width, height] = [view.getUint32(0), view.getUint32(4)];
  if (width < 1 || height < 1 || Math.max(width, height) > MOST) return null;
  /** @type {unknown} */
  let told;
  try {
    told = JSON.parse(letters.slice(end + 1));
  } catch {
    return null;
  }
  const { resolution, x, y, yaw, frame } = /** @type {Record<string, unknown>} */ (told ?? {});
  const isPlace = [resolution, x, y, yaw].every((one) => Number.isFinite(one)) && Number(resolution) > 0;
  if (!isPlace) return null;
  return {
    ...{ width, height, resolution: Number(resolution), x: Number(x), y: Number(y), yaw: Number(yaw) },
    frame: typeof frame === "string" ? frame : "",
  };
}

/**
 * Return the size of a grid as text.
 *
 * @param {GridPlace} place
 */
export function sizeText({ width, height, resolution }) {
  return `${(width * resolution).toFixed(1)} × ${(height * resolution).toFixed(1)} m`;
}

/**
 * Return the four corners of a grid as [y, x] in metres, in order around the grid.
 *
 * @param {GridPlace} place
 * @returns {[number, number][]}
 */
export function cornersOf({ width, height, resolution, x, y, yaw }) {
  const [along, across] = [width * resolution, height * resolution];
  const [cos, sin] = [Math.cos(yaw), Math.sin(yaw)];
  const at = (/** @type {number} */ u, /** @type {number} */ v) =>
    /** @type {[number, number]} */ ([y + u * sin + v * cos, x + u * cos - v * sin]);
  return [at(0, 0), at(along, 0), at(along, across), at(0, across)];
}

/**
 * Return the image with other colours.
 *
 * @param {Uint8Array<ArrayBuffer>} image
 * @param {(value: number) => Colour} colour colour of an occupancy in percent; −1 means unknown
 * @returns {Uint8Array<ArrayBuffer>[]} the parts of the new image
 */
export function recoloured(image, colour) {
  const [solid, clear] = [new Uint8Array(3 * COLOURS), new Uint8Array(COLOURS)];
  for (let index = 0; index < COLOURS; index += 1) {
    const [red, green, blue, opacity] = colour(index <= FULL ? index : -1);
    solid.set([red, green, blue], 3 * index);
    clear[index] = opacity;
  }
  const [start, end] = spanOf(image, "PLTE") ?? [0, 0];
  if (end === 0) return [image];
  return [image.slice(0, start), chunk("PLTE", solid), chunk("tRNS", clear), image.slice(end)];
}

/**
 * Return the parts of a CSS colour such as `rgb(1, 2, 3)`, which browsers return for used colours.
 *
 * @param {string} text
 * @returns {[number, number, number]}
 */
export function partsOf(text) {
  const [red = 128, green = 128, blue = 128] = (text.match(/[\d.]+/g) ?? []).map(Number);
  return [red, green, blue];
}

/**
 * Return a colour between two colours.
 *
 * @param {readonly [number, number, number]} from
 * @param {readonly [number, number, number]} to
 * @param {number} share 0 for the first colour, 1 for the second
 * @returns {[number, number, number]}
 */
export function between(from, to, share) {
  const mix = (/** @type {0 | 1 | 2} */ part) => Math.round(from[part] + (to[part] - from[part]) * share);
  return [mix(0), mix(1), mix(2)];
}

/**
 * @param {Uint8Array} image
 * @param {string} kind
 */
function chunkOf(image, kind) {
  const [start, end] = spanOf(image, kind) ?? [0, 0];
  return end === 0 ? null : image.subarray(start + 8, end - 4);
}

/**
 * Return the start and end of a chunk, or null.
 *
 * @param {Uint8Array} image
 * @param {string} kind
 * @returns {[number, number] | null}
 */
function spanOf(image, kind) {
  if (MAGIC.some((byte, place) => image[place] !== byte)) return null;
  const view = new DataView(image.buffer, image.byteOffset, image.byteLength);
  let at = MAGIC.length;
  while (at + 12 <= image.length) {
    const end = at + 12 + view.getUint32(at);
    if (end > image.length) return null;
    if (String.fromCharCode(...image.subarray(at + 4, at + 8)) === kind) return [at, end];
    at = end;
  }
  return null;
}

/**
 * @param {string} kind
 * @param {Uint8Array} body
 * @returns {Uint8Array<ArrayBuffer>}
 */
function chunk(kind, body) {
  const made = new Uint8Array(12 + body.length);
  const view = new DataView(made.buffer);
  view.setUint32(0, body.length);
  made.set([...kind].map((letter) => letter.charCodeAt(0)), 4);
  made.set(body, 8);
  view.setUint32(8 + body.length, crc32(made.subarray(4, 8 + body.length)));
  return made;
}

/**
 * Return the checksum of a chunk (PNG, ISO/IEC 15948, annex D). Palettes are short, so there is no
 * table.
 *
 * @param {Uint8Array} bytes
 */
export function crc32(bytes) {
  let sum = 0xffffffff;
  for (const byte of bytes) {
    sum ^= byte;
    for (let bit = 0; bit < 8; bit += 1) sum = (sum >>> 1) ^ (sum & 1 ? 0xedb88320 : 0);
  }
  return (sum ^ 0xffffffff) >>> 0;
}
