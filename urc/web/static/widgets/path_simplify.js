// @ts-check
/**
 * Drawn lines: `import { simplified, polar } from "urc/path_simplify"`. Pure maths.
 *
 * @typedef {readonly [number, number]} Point x forward, y left (REP 103), in the command's unit
 */

/** Maximum number of simplification rounds, after which the tolerance is larger than any pad. */
const ROUNDS = 24;

/**
 * Return a line with fewer points, at most `tolerance` away from the given line.
 *
 * The first and last points stay (Douglas and Peucker, without recursion).
 *
 * @param {readonly Point[]} points
 * @param {number} tolerance
 * @returns {Point[]}
 */
export function simplified(points, tolerance) {
  if (points.length <= 2) return [...points];
  const isKept = new Uint8Array(points.length);
  isKept[0] = isKept[points.length - 1] = 1;
  /** @type {[number, number][]} */
  const spans = [[0, points.length - 1]];
  for (let span = spans.pop(); span; span = spans.pop()) {
    const [first, last] = span;
    const [place, far] = farthest(points, first, last);
    if (far <= tolerance) continue;
    isKept[place] = 1;
    spans.push([first, place], [place, last]);
  }
  return points.filter((_, place) => isKept[place] === 1);
}

/**
 * @param {readonly Point[]} points
 * @param {number} first
 * @param {number} last
 * @returns {[number, number]} index and distance of the point farthest from the chord
 */
function farthest(points, first, last) {
  let [place, far] = [first, -1];
  const [from, to] = [/** @type {Point} */ (points[first]), /** @type {Point} */ (points[last])];
  for (let at = first + 1; at < last; at += 1) {
    const away = distance(/** @type {Point} */ (points[at]), from, to);
    if (away > far) [place, far] = [at, away];
  }
  return [place, far];
}

/**
 * Return the distance of a point from a line segment.
 *
 * @param {Point} point
 * @param {Point} from
 * @param {Point} to
 */
export function distance([x, y], [fromX, fromY], [toX, toY]) {
  const [alongX, alongY] = [toX - fromX, toY - fromY];
  const length = alongX ** 2 + alongY ** 2;
  const share = length > 0 ? ((x - fromX) * alongX + (y - fromY) * alongY) / length : 0;
  const kept = Math.min(1, Math.max(0, share));
  return Math.hypot(x - fromX - kept * alongX, y - fromY - kept * alongY);
}

/**
 * Return one line from several strokes, with at most `most` points. Each stroke is simplified until
 * the number is small enough.
 *
 * @param {readonly (readonly Point[])[]} strokes
 * @param {number} tolerance
 * @param {number} most at least 2
 * @returns {Point[]}
 */
export function fitted(strokes, tolerance, most) {
  let points = strokes.flatMap((stroke) => simplified(stroke, tolerance));
  let allowed = Math.max(tolerance, 1e-4);
  for (let round = 0; points.length > most && round < ROUNDS; round += 1) {
    allowed *= 2;
    points = simplified(points, allowed);
  }
  return points.length > most ? points.slice(0, most) : points;
}

/**
 * Return the length of a line.
 *
 * @param {readonly Point[]} points
 */
export function lengthOf(points) {
  let sum = 0;
  points.forEach(([x, y], place) => {
    const [lastX, lastY] = points[place - 1] ?? [x, y];
    sum += Math.hypot(x - lastX, y - lastY);
  });
  return sum;
}

/**
 * Return heading and distance of a vector. The heading is in radians; ahead is 0 and left is
 * positive.
 *
 * @param {number} dx
 * @param {number} dy
 */
export function polar(dx, dy) {
  return { heading: Math.atan2(dy, dx) + 0, distance: Math.hypot(dx, dy) };
}

/**
 * Limit a vector to the longest allowed length.
 *
 * @param {number} dx
 * @param {number} dy
 * @param {number} longest
 * @returns {[number, number]}
 */
export function cutTo(dx, dy, longest) {
  const size = Math.hypot(dx, dy);
  return size > longest ? [(dx * longest) / size, (dy * longest) / size] : [dx, dy];
}
