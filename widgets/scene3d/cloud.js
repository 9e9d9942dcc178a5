// @ts-check
/**
 * Point clouds: the PCD file of the server as points and colours for three.js. Pure: no DOM.
 *
 * The counterpart in Python is `urc/protocol/values/point_cloud.py`. All values have four bytes,
 * little-endian, like all machines with WebGL. The first value of the file begins at a multiple of
 * four bytes.
 *
 * @typedef {import("./pose.js").Convention} Convention
 * @typedef {{count: number, stride: number, colour: string, total: number, frame: string,
 *   numbers: Float32Array, words: Uint32Array}} Cloud
 * @typedef {(share: number) => readonly [number, number, number]} Ramp colour for 0 to 1, each part
 *   from 0 to 1, in the linear colour space of three.js
 */
const COMMENT = "# urc point cloud ";
const LAST_LINE = "DATA binary\n";
const LONGEST_HEADER = 4096;
/** Colour fields that contain a colour. */
export const COLOURS = Object.freeze(["rgb", "rgba"]);
/** Number of points that determine the range of the colours. */
const PROBES = 1000;
/** Share of the points below and above the range of the colours. */
const OUTSIDE = 0.02;

/**
 * Return the cloud in a file; throw an error for any other file.
 *
 * @param {ArrayBuffer} data
 * @returns {Cloud}
 */
export function readCloud(data) {
  const head = new TextDecoder("latin1").decode(new Uint8Array(data, 0, Math.min(LONGEST_HEADER, data.byteLength)));
  const end = head.indexOf(LAST_LINE);
  const start = end + LAST_LINE.length;
  if (!head.startsWith(COMMENT) || end < 0 || start % 4 !== 0) throw new Error("no point cloud");
  const [first = "", ...lines] = head.slice(0, end).split("\n");
  const { frame, total } = JSON.parse(first.slice(COMMENT.length));
  const keys = new Map(lines.map((line) => [line.split(" ", 1)[0], line.slice(line.indexOf(" ") + 1)]));
  const names = (keys.get("FIELDS") ?? "").split(" ");
  const count = Number(keys.get("POINTS"));
  const stride = names.length;
  const isRight = names.slice(0, 3).join() === "x,y,z" && (stride === 3 || stride === 4);
  if (!isRight || !Number.isInteger(count) || data.byteLength - start !== 4 * stride * count) throw new Error("no point cloud");
  return {
    count,
    stride,
    colour: names[3] ?? "",
    total: Number(total),
    frame: String(frame),
    numbers: new Float32Array(data, start),
    words: new Uint32Array(data, start),
  };
}

/**
 * Return the positions in FLU, with every nth point if the cloud has more than `most` points.
 *
 * @param {Cloud} cloud
 * @param {number} most
 * @param {Convention} convention
 */
export function placesOf({ count, stride, numbers }, most, convention) {
  const every = Math.max(1, Math.ceil(count / Math.max(1, most)));
  const sense = convention === "FRD" ? -1 : 1;
  const places = new Float32Array(3 * Math.ceil(count / every));
  for (let from = 0, to = 0; to < places.length; from += every * stride, to += 3) {
    places[to] = numbers[from] ?? 0;
    places[to + 1] = sense * (numbers[from + 1] ?? 0);
    places[to + 2] = sense * (numbers[from + 2] ?? 0);
  }
  return places;
}

/**
 * Return the smallest and the largest of most values; single outliers do not count.
 *
 * @param {Float32Array} numbers
 * @param {number} stride
 * @param {number} offset
 * @returns {[number, number]}
 */
export function rangeOf(numbers, stride, offset) {
  const count = Math.floor(numbers.length / stride);
  const every = Math.max(1, Math.floor(count / PROBES));
  /** @type {number[]} */
  const probes = [];
  for (let point = 0; point < count; point += every) {
    const value = numbers[point * stride + offset] ?? NaN;
    if (Number.isFinite(value)) probes.push(value);
  }
  probes.sort((one, other) => one - other);
  const at = (/** @type {number} */ share) => probes[Math.round(share * (probes.length - 1))] ?? 0;
  return [at(OUTSIDE), at(1 - OUTSIDE)];
}

/**
 * Return the colours of the positions of `placesOf`.
 *
 * @param {Cloud} cloud
 * @param {Float32Array} places
 * @param {"height" | "field"} by
 * @param {Ramp} ramp
 */
export function coloursOf(cloud, places, by, ramp) {
  const count = places.length / 3;
  const every = count > 0 ? Math.ceil(cloud.count / count) : 1;
  const colours = new Float32Array(places.length);
  const isColour = by === "field" && COLOURS.includes(cloud.colour);
  const isField = by === "field" && cloud.stride === 4;
  const [values, step, offset] = isField ? [cloud.numbers, cloud.stride * every, 3] : [places, 3, 2];
  const [low, high] = isColour ? [0, 1] : rangeOf(values, isField ? cloud.stride : 3, offset);
  const steps = Array.from({ length: 256 }, (_, index) => (isColour ? linear(index / 255) : ramp(index / 255)));
  for (let point = 0, to = 0; point < count; point += 1, to += 3) {
    if (isColour) {
      const word = cloud.words[point * step + 3] ?? 0;
      for (let part = 0; part < 3; part += 1) colours[to + part] = steps[(word >> (16 - 8 * part)) & 255]?.[part] ?? 0;
      continue;
    }
    const value = values[point * step + offset] ?? NaN;
    const share = high > low ? (value - low) / (high - low) : 0.5;
    const index = Math.round(255 * Math.min(1, Math.max(0, Number.isFinite(share) ? share : 0)));
    colours.set(steps[index] ?? [0, 0, 0], to);
  }
  return colours;
}

/**
 * Return a grey of sRGB in the linear colour space.
 *
 * @param {number} part
 * @returns {readonly [number, number, number]}
 */
function linear(part) {
  const value = part <= 0.04045 ? part / 12.92 : ((part + 0.055) / 1.055) ** 2.4;
  return [value, value, value];
}
