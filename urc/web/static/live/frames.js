// @ts-check
/**
 * Binary messages from the server, each with one image or a signal's bytes. See
 * `urc/web/wire/picture.py`.
 *
 *     0  u8   1: an image             4  u32  its age in milliseconds at the moment of sending
 *     1  u8   length of the type      8  f64  the server's clock then, in milliseconds
 *     2  u16  index of the signal    16       media type in ASCII, then the bytes
 *
 * @typedef {object} BinaryFrame
 * @property {number} index
 * @property {number} ageMs
 * @property {number} sentMs
 * @property {string} type
 * @property {Uint8Array<ArrayBuffer>} bytes
 */

const PICTURE = 1;
const HEADER = 16;

/**
 * @param {ArrayBuffer} data
 * @returns {BinaryFrame | null} null for an unknown kind
 */
export function frameOf(data) {
  if (data.byteLength < HEADER) return null;
  const view = new DataView(data);
  const typeLength = view.getUint8(1);
  if (view.getUint8(0) !== PICTURE || data.byteLength < HEADER + typeLength) return null;
  const letters = new Uint8Array(data, HEADER, typeLength);
  return {
    index: view.getUint16(2),
    ageMs: view.getUint32(4),
    sentMs: view.getFloat64(8),
    type: String.fromCharCode(...letters),
    bytes: new Uint8Array(data, HEADER + typeLength),
  };
}
