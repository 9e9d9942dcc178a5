// @ts-check
/**
 * A depth image in metres, from bytes, numbers or a PNG. Pure: no DOM.
 *
 * @typedef {{width: number, height: number, metres: Float32Array}} Field Distances; NaN if unknown.
 * @typedef {"16UC1" | "32FC1" | "8UC1"} Encoding
 * @typedef {{encoding: Encoding, width: number, height: number, bigEndian: boolean, scale: number}} Form
 *   `scale`: metres per unit of the image.
 */
import { MOST_PIXELS, isPng, readPng } from "./png.js";

const BYTES = { "8UC1": 1, "16UC1": 2, "32FC1": 4 };

/**
 * Return the depths in a file or in raw bytes.
 *
 * A PNG may follow the 12 bytes that ROS adds before a compressed depth image: the format, and two
 * numbers for the conversion of floating-point depths to integers.
 *
 * @param {Uint8Array} bytes
 * @param {Form} form
 * @returns {Promise<Field>}
 */
export async function readField(bytes, form) {
  const from = isPng(bytes) ? 0 : isPng(bytes, 12) ? 12 : -1;
  if (from < 0) return rawField(bytes, form);
  const { width, height, values } = await readPng(bytes.subarray(from));
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const [a, b] = from === 12 ? [view.getFloat32(4, true), view.getFloat32(8, true)] : [0, 0];
  const isInverse = form.encoding === "32FC1" && a > 0;
  const metres = Float32Array.from(values, (value) => {
    if (value === 0) return NaN;
    return isInverse ? a / (value - b) : value * form.scale;
  });
  return { width, height, metres };
}

/**
 * @param {Uint8Array} bytes rows from the top, without padding
 * @param {Form} form
 * @returns {Field}
 */
export function rawField(bytes, { encoding, width, height, bigEndian, scale }) {
  const count = pixels(width, height);
  const wanted = count * BYTES[encoding];
  if (bytes.length !== wanted) {
    throw new Error(`${bytes.length} bytes came; ${width} × ${height} of ${encoding} are ${wanted}`);
  }
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const metres = new Float32Array(count);
  for (let index = 0; index < count; index += 1) {
    metres[index] = valueAt(view, index, encoding, !bigEndian) * scale;
  }
  return { width, height, metres };
}

/**
 * @param {DataView} view
 * @param {number} index
 * @param {Encoding} encoding
 * @param {boolean} isLittle
 */
function valueAt(view, index, encoding, isLittle) {
  if (encoding === "32FC1") {
    const value = view.getFloat32(4 * index, isLittle);
    return value === 0 ? NaN : value;
  }
  const whole = encoding === "16UC1" ? view.getUint16(2 * index, isLittle) : view.getUint8(index);
  return whole === 0 ? NaN : whole;
}

/**
 * @param {readonly unknown[]} values
 * @param {Form} form
 * @returns {Field}
 */
export function arrayField(values, { width, height, scale }) {
  const count = pixels(width, height);
  if (values.length !== count) {
    throw new Error(`${values.length} numbers came; ${width} × ${height} are ${count}`);
  }
  const metres = new Float32Array(count);
  for (let index = 0; index < count; index += 1) {
    const value = values[index];
    metres[index] = typeof value === "number" && value !== 0 ? value * scale : NaN;
  }
  return { width, height, metres };
}

/**
 * @param {number} width
 * @param {number} height
 */
function pixels(width, height) {
  const count = width * height;
  if (count < 1) throw new Error("set the options width and height: raw images don't say their size");
  if (count > MOST_PIXELS) throw new Error(`${width} × ${height} pixels are not shown: at most ${MOST_PIXELS}`);
  return count;
}

/**
 * Write the field as pixels: near is bright, far is dark, and unknown pixels are `unknown`.
 * @param {Field} field
 * @param {{near: number, far: number}} clip metres
 * @param {Uint32Array} palette 256 pixels
 * @param {number} unknown a pixel
 * @param {Uint32Array} into
 */
export function paint({ metres }, { near, far }, palette, unknown, into) {
  const scale = 255 / Math.max(1e-6, far - near);
  for (let index = 0; index < metres.length; index += 1) {
    const distance = metres[index] ?? NaN;
    if (distance !== distance) into[index] = unknown;
    else {
      const step = 255 - (distance - near) * scale;
      into[index] = palette[step < 0 ? 0 : step > 255 ? 255 : step | 0] ?? unknown;
    }
  }
}

/**
 * Return the distance at a point, given as fractions of the image: the median of the known pixels among
 * the nine pixels around the point, or NaN if none is known.
 *
 * @param {Field} field
 * @param {number} x 0 to 1
 * @param {number} y 0 to 1
 */
export function probe({ width, height, metres }, x, y) {
  const [column, row] = pixelAt({ width, height }, x, y);
  /** @type {number[]} */
  const found = [];
  for (let dy = -1; dy <= 1; dy += 1) {
    for (let dx = -1; dx <= 1; dx += 1) {
      const [px, py] = [column + dx, row + dy];
      const value = px >= 0 && py >= 0 && px < width && py < height ? metres[py * width + px] : NaN;
      if (value !== undefined && value === value) found.push(value);
    }
  }
  found.sort((one, other) => one - other);
  return found.length > 0 ? (found[Math.floor(found.length / 2)] ?? NaN) : NaN;
}

/**
 * @param {{width: number, height: number}} size
 * @param {number} x
 * @param {number} y
 * @returns {[number, number]} column and row
 */
export function pixelAt({ width, height }, x, y) {
  const inside = (/** @type {number} */ share, /** @type {number} */ count) =>
    Math.min(count - 1, Math.max(0, Math.floor(share * count)));
  return [inside(x, width), inside(y, height)];
}
