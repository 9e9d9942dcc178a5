// @ts-check
/**
 * Binary messages from the server, each with one image or a signal's bytes. See
 * `urc/web/wire/picture.py`.
 *
 *     0  u8   1: an image; 3: an      4  u32  its age in milliseconds at the moment of sending
 *             image that is repeated
 *     1  u8   length of the type      8  f64  the server's clock then, in milliseconds
 *     2  u16  index of the signal    16  u32  number of the image
 *                                    20       media type in ASCII, then the bytes
 *
 * @typedef {object} BinaryFrame
 * @property {number} index
 * @property {number} ageMs
 * @property {number} sentMs
 * @property {number} number Number of the image; those of one stream of a video are consecutive. Numbers above
 *   `FIRST_LOW` belong to the low stream.
 * @property {string} type media type, or the codec string of a video
 * @property {Uint8Array<ArrayBuffer>} bytes
 * @property {boolean | undefined} [isRepeated] Whether the camera repeats the image.
 * @property {VideoPart} [video] Only for an access unit.
 *
 * @typedef {object} VideoPart
 * @property {number} width pixels
 * @property {number} height
 * @property {boolean} isKey Whether decoding can start with this access unit.
 * @property {boolean} isSparse Whether this page receives keyframes only, because its line bears no more.
 */

/** Number before the first access unit of a low stream. */
export const FIRST_LOW = 2 ** 31;
const PICTURE = 1;
const VIDEO = 2;
const REPEATED = 3;
/** Flags of an access unit. */
const [KEY, SPARSE] = [1, 4];
const HEADER = 20;
const VIDEO_HEADER = 25;

/**
 * @param {ArrayBuffer} data
 * @returns {BinaryFrame | null} null for an unknown kind
 */
export function frameOf(data) {
  if (data.byteLength < HEADER) return null;
  const view = new DataView(data);
  const [kind, typeLength] = [view.getUint8(0), view.getUint8(1)];
  if (kind !== PICTURE && kind !== VIDEO && kind !== REPEATED) return null;
  const header = kind === VIDEO ? VIDEO_HEADER : HEADER;
  if (data.byteLength < header + typeLength) return null;
  const letters = new Uint8Array(data, header, typeLength);
  const frame = {
    index: view.getUint16(2),
    ageMs: view.getUint32(4),
    sentMs: view.getFloat64(8),
    number: view.getUint32(16),
    type: String.fromCharCode(...letters),
    bytes: new Uint8Array(data, header + typeLength),
  };
  if (kind === PICTURE) return frame;
  if (kind === REPEATED) return { ...frame, isRepeated: true };
  const flags = view.getUint8(24);
  const video = {
    width: view.getUint16(20),
    height: view.getUint16(22),
    isKey: (flags & KEY) !== 0,
    isSparse: (flags & SPARSE) !== 0,
  };
  return { ...frame, video };
}
