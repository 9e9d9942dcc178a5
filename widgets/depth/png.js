// @ts-check
/**
 * A decoder for grey PNGs with all 16 bits: the browser's decoder returns only 8 bits. Pure except for
 * DecompressionStream, which browsers and Node provide.
 *
 * @typedef {{width: number, height: number, bits: number, values: Uint16Array}} Grey
 */

const MARK = [137, 80, 78, 71, 13, 10, 26, 10];
/** Size limit, larger than the images of any depth camera: a hostile file must not fill the page's memory. */
export const MOST_PIXELS = 4_194_304;

/**
 * Return whether a PNG begins at `from`.
 *
 * @param {Uint8Array} bytes
 * @param {number} [from]
 */
export function isPng(bytes, from = 0) {
  return MARK.every((byte, index) => bytes[from + index] === byte);
}

/**
 * @param {Uint8Array} bytes
 * @returns {Promise<Grey>}
 */
export async function readPng(bytes) {
  if (!isPng(bytes)) throw new Error("this is no PNG");
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  /** @type {Uint8Array[]} */
  const parts = [];
  let head = null;
  for (let at = 8; at + 12 <= bytes.length; ) {
    const length = view.getUint32(at);
    const kind = String.fromCharCode(...bytes.subarray(at + 4, at + 8));
    const body = bytes.subarray(at + 8, at + 8 + length);
    if (body.length < length) throw new Error("the PNG ends too early");
    if (kind === "IHDR") head = readHead(body);
    if (kind === "IDAT") parts.push(body);
    if (kind === "IEND") break;
    at += 12 + length;
  }
  if (!head) throw new Error("the PNG has no head");
  const rowBytes = head.width * (head.bits / 8);
  const raw = await inflate(parts, head.height * (rowBytes + 1));
  return { ...head, values: unfilter(raw, head, rowBytes) };
}

/** @param {Uint8Array} body */
function readHead(body) {
  const view = new DataView(body.buffer, body.byteOffset, body.byteLength);
  const [width, height, bits] = [view.getUint32(0), view.getUint32(4), view.getUint8(8)];
  if (view.getUint8(9) !== 0 || (bits !== 8 && bits !== 16)) {
    throw new Error("only a PNG of one grey channel with 8 or 16 bits is a depth image");
  }
  if (view.getUint8(12) !== 0) throw new Error("an interlaced PNG is not read");
  if (width * height > MOST_PIXELS || width * height === 0) {
    throw new Error(`${width} × ${height} pixels are not shown: at most ${MOST_PIXELS}`);
  }
  return { width, height, bits };
}

/**
 * @param {Uint8Array[]} parts
 * @param {number} size
 */
async function inflate(parts, size) {
  const packed = new Blob(/** @type {BlobPart[]} */ (parts)).stream();
  const reader = packed.pipeThrough(new DecompressionStream("deflate")).getReader();
  const out = new Uint8Array(size);
  let at = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    if (at + value.length > size) {
      await reader.cancel();
      throw new Error("the PNG holds more than its size says");
    }
    out.set(value, at);
    at += value.length;
  }
  if (at < size) throw new Error("the PNG holds less than its size says");
  return out;
}

/**
 * @param {Uint8Array} raw rows, each with its filter type first
 * @param {{width: number, height: number, bits: number}} head
 * @param {number} rowBytes
 */
function unfilter(raw, { width, height, bits }, rowBytes) {
  const step = bits / 8;
  const values = new Uint16Array(width * height);
  let above = new Uint8Array(rowBytes);
  for (let row = 0; row < height; row += 1) {
    const from = row * (rowBytes + 1);
    const line = raw.subarray(from + 1, from + 1 + rowBytes);
    undo(raw[from] ?? 0, line, above, step);
    for (let x = 0; x < width; x += 1) {
      const high = line[x * step] ?? 0;
      values[row * width + x] = step === 2 ? (high << 8) | (line[2 * x + 1] ?? 0) : high;
    }
    above = /** @type {Uint8Array<ArrayBuffer>} */ (line);
  }
  return values;
}

/**
 * @param {number} kind
 * @param {Uint8Array} line row, changed in place
 * @param {Uint8Array} above
 * @param {number} step bytes for each pixel
 */
function undo(kind, line, above, step) {
  if (kind > 4) throw new Error(`the PNG has an unknown filter ${kind}`);
  for (let x = 0; kind > 0 && x < line.length; x += 1) {
    const left = x >= step ? (line[x - step] ?? 0) : 0;
    const up = above[x] ?? 0;
    const corner = x >= step ? (above[x - step] ?? 0) : 0;
    const guess = [0, left, up, (left + up) >> 1, paeth(left, up, corner)][kind] ?? 0;
    line[x] = ((line[x] ?? 0) + guess) & 255;
  }
}

/**
 * @param {number} left
 * @param {number} up
 * @param {number} corner
 */
function paeth(left, up, corner) {
  const guess = left + up - corner;
  const [a, b, c] = [Math.abs(guess - left), Math.abs(guess - up), Math.abs(guess - corner)];
  if (a <= b && a <= c) return left;
  return b <= c ? up : corner;
}
