// @ts-check
/**
 * Places on the Earth, or on a robot's own map. Pure: no DOM, no Leaflet.
 *
 * A place is `[first, second]`: latitude and longitude in degrees, or y and x in metres on the robot's
 * own map. Leaflet has the upward coordinate first.
 *
 * @typedef {[number, number]} Place
 */

const EARTH_M = 6_371_008.8;
const RAD = Math.PI / 180;
/** Largest coordinate on a robot's own map: the Earth's circumference. Larger numbers are noise. */
const FARTHEST_M = 4e7;

/**
 * Return the distance in metres.
 *
 * @param {Place} one
 * @param {Place} other
 * @param {boolean} isLocal
 */
export function distance(one, other, isLocal) {
  if (isLocal) return Math.hypot(one[0] - other[0], one[1] - other[1]);
  const north = (other[0] - one[0]) * RAD;
  const east = (other[1] - one[1]) * RAD;
  const half =
    Math.sin(north / 2) ** 2 +
    Math.cos(one[0] * RAD) * Math.cos(other[0] * RAD) * Math.sin(east / 2) ** 2;
  return 2 * EARTH_M * Math.asin(Math.min(1, Math.sqrt(half)));
}

/**
 * Return the length of a route in metres.
 *
 * @param {readonly Place[]} way
 * @param {boolean} isLocal
 */
export function lengthOf(way, isLocal) {
  return way.reduce((sum, place, index) => {
    const before = way[index - 1];
    return before ? sum + distance(before, place, isLocal) : sum;
  }, 0);
}

/**
 * Return one metre in degrees of latitude and longitude; 1 and 1 on a robot's own map.
 *
 * @param {Place} origin
 * @param {boolean} isLocal
 * @returns {Place}
 */
export function perMetre(origin, isLocal) {
  if (isLocal) return [1, 1];
  const degree = 1 / (EARTH_M * RAD);
  return [degree, degree / Math.max(0.01, Math.cos(origin[0] * RAD))];
}

/**
 * Return whether a place is within the fence; always true without a fence.
 *
 * @param {Place} place
 * @param {readonly Place[]} fence
 */
export function isInside(place, fence) {
  if (fence.length < 3) return true;
  let inside = false;
  const [y, x] = place;
  for (let index = 0, before = fence.length - 1; index < fence.length; before = index, index += 1) {
    const [ay, ax] = fence[index] ?? [0, 0];
    const [by, bx] = fence[before] ?? [0, 0];
    if (ay > y !== by > y && x < ((bx - ax) * (y - ay)) / (by - ay) + ax) inside = !inside;
  }
  return inside;
}

/**
 * Return the fence or route in an option: pairs of numbers, without invalid pairs.
 *
 * @param {unknown} value
 * @param {boolean} isLocal whether pairs are x, y; else latitude, longitude
 * @returns {Place[]}
 */
export function placesOf(value, isLocal) {
  if (!Array.isArray(value)) return [];
  return value.flatMap((pair) => {
    const [first, second] = Array.isArray(pair) ? pair : [];
    if (!Number.isFinite(first) || !Number.isFinite(second)) return [];
    return [isLocal ? [second, first] : [first, second]];
  });
}

/**
 * Return two numbers as a place, or null if they are invalid.
 *
 * @param {number | null} first
 * @param {number | null} second
 * @param {boolean} isLocal
 * @returns {Place | null}
 */
export function placeOf(first, second, isLocal) {
  if (first === null || second === null) return null;
  if (isLocal && Math.max(Math.abs(first), Math.abs(second)) > FARTHEST_M) return null;
  if (!isLocal && (Math.abs(first) > 90 || Math.abs(second) > 360)) return null;
  return [first, second];
}

/**
 * Return an angle in degrees, minutes and seconds with its hemisphere, such as `46°31′10.9″ N`.
 *
 * @param {number} degrees
 * @param {"NS" | "EW"} sides letters, the positive one first
 */
export function sexagesimal(degrees, sides) {
  // The whole angle is rounded, so that 59.96 seconds never become 60.0.
  const tenths = Math.round(Math.abs(degrees) * 36_000);
  const seconds = ((tenths % 600) / 10).toFixed(1).padStart(4, "0");
  const minutes = String(Math.floor(tenths / 600) % 60).padStart(2, "0");
  const side = degrees < 0 ? sides[1] : sides[0];
  return `${Math.floor(tenths / 36_000)}°${minutes}′${seconds}″ ${side}`;
}

/**
 * Return a place as text.
 *
 * @param {Place} place
 * @param {"decimal" | "dms"} form
 * @param {boolean} isLocal
 */
export function placeText([first, second], form, isLocal) {
  if (isLocal) return `x ${second.toFixed(2)} m, y ${first.toFixed(2)} m`;
  if (form === "dms") return `${sexagesimal(first, "NS")}, ${sexagesimal(second, "EW")}`;
  const side = (/** @type {number} */ value, /** @type {string} */ sides) =>
    `${Math.abs(value).toFixed(6)}° ${value < 0 ? sides[1] : sides[0]}`;
  return `${side(first, "NS")}, ${side(second, "EW")}`;
}

/**
 * Return a distance as text.
 *
 * @param {number} metres
 */
export function distanceText(metres) {
  if (metres < 10) return `${metres.toFixed(1)} m`;
  return metres < 1000 ? `${Math.round(metres)} m` : `${(metres / 1000).toFixed(2)} km`;
}

/**
 * Return the bearing in degrees, clockwise from up, of a yaw in radians, counter-clockwise from the x
 * axis (REP 103).
 *
 * @param {number} yaw
 */
export function bearingOf(yaw) {
  return (((90 - yaw / RAD) % 360) + 360) % 360;
}

/**
 * Return a bearing as text with three figures, such as `007°`.
 *
 * @param {number} bearing in degrees
 */
export function headingText(bearing) {
  return `${String(((Math.round(bearing) % 360) + 360) % 360).padStart(3, "0")}°`;
}

/**
 * Return a round grid spacing in metres: 1, 2 or 5 times a power of ten, at least `pixels` apart.
 *
 * @param {number} metresPerPixel
 * @param {number} [pixels]
 */
export function gridStep(metresPerPixel, pixels = 64) {
  const rough = metresPerPixel * pixels;
  if (!(rough > 0) || !Number.isFinite(rough)) return 1;
  const power = 10 ** Math.floor(Math.log10(rough));
  return ([1, 2, 5, 10].find((each) => each * power >= rough * 0.999) ?? 10) * power;
}

/**
 * Return latitude, longitude and accuracy in a message such as NavSatFix.
 *
 * @param {unknown} fix
 * @returns {{place: Place | null, accuracy: number | null}}
 */
export function readFix(fix) {
  if (typeof fix !== "object" || fix === null || Array.isArray(fix)) return { place: null, accuracy: null };
  const { latitude, longitude, position_covariance: covariance, status } =
    /** @type {Record<string, unknown>} */ (fix);
  const state = typeof status === "object" && status !== null ? Reflect.get(status, "status") : status;
  const has = typeof state !== "number" || state >= 0;
  const place =
    has && typeof latitude === "number" && typeof longitude === "number"
      ? placeOf(latitude, longitude, false)
      : null;
  const list = Array.isArray(covariance) ? covariance : [];
  const spread = Number(list[0]) + Number(list[4]);
  // One number for both directions: the square root of their mean variance.
  return { place, accuracy: spread > 0 && Number.isFinite(spread) ? Math.sqrt(spread / 2) : null };
}

/** Speed above which a robot did not move, but its map or its position was reset, in m/s. */
const FASTEST = { onEarth: 150, onMap: 20 };
/** Shortest jump, in metres, and shortest time between two places, in milliseconds. */
const JUMP_M = 1;
const LEAST_MS = 50;

/**
 * The trail of past places, limited in number and with a minimum distance. A jump starts a new trail, as
 * no robot has moved along the line between its ends.
 */
export class Trail {
  /**
   * @param {number} most largest number of places
   * @param {number} apart minimum distance in metres
   * @param {boolean} isLocal
   */
  constructor(most, apart, isLocal) {
    this.most = most;
    this.apart = apart;
    this.isLocal = isLocal;
    /** @type {Place[]} */
    this.places = [];
    /** Newest place, which may be too near for the trail. @type {Place | null} */
    this.newest = null;
    this.newestMs = 0;
  }

  clear() {
    this.places = this.places.slice(-1);
  }

  /**
   * @param {Place} place
   * @param {number} nowMs
   * @returns {boolean} whether it is a new place
   */
  add(place, nowMs) {
    if (this.newest && this.isJump(this.newest, place, nowMs - this.newestMs)) this.places = [];
    [this.newest, this.newestMs] = [place, nowMs];
    const last = this.places.at(-1);
    if (last && distance(last, place, this.isLocal) < this.apart) return false;
    this.places.push(place);
    if (this.places.length > this.most) this.places.shift();
    return this.most > 0;
  }

  /**
   * @param {Place} from
   * @param {Place} to
   * @param {number} tookMs
   */
  isJump(from, to, tookMs) {
    const metres = distance(from, to, this.isLocal);
    const fastest = this.isLocal ? FASTEST.onMap : FASTEST.onEarth;
    return metres > JUMP_M && metres > (fastest * Math.max(LEAST_MS, tookMs)) / 1000;
  }
}

/** Standard deviations of an ellipse that contains a normally distributed position with 95 %. */
const SIGMAS = Math.sqrt(5.991);
const CORNERS = 48;

/** Return whether a place on the robot's own map is near enough to be drawn. @param {Place} place */
export function isInMap([y, x]) {
  return Math.max(Math.abs(x), Math.abs(y)) <= FARTHEST_M;
}

/**
 * Return the places in an array of x and y in turn, without invalid places.
 *
 * @param {unknown} value
 * @returns {Place[]}
 */
export function pairsOf(value) {
  if (!Array.isArray(value)) return [];
  /** @type {Place[]} */
  const found = [];
  for (let index = 0; index + 1 < value.length; index += 2) {
    const [x, y] = [value[index], value[index + 1]];
    if (typeof x === "number" && typeof y === "number" && isInMap([y, x])) found.push([y, x]);
  }
  return found;
}

/**
 * Return the places and directions in an array of x, y, and the z and w of the orientation in turn,
 * without invalid poses.
 *
 * @param {unknown} value
 * @returns {{place: Place, yaw: number}[]}
 */
export function posesOf(value) {
  if (!Array.isArray(value)) return [];
  const found = [];
  for (let index = 0; index + 3 < value.length; index += 4) {
    const [x, y, z, w] = value.slice(index, index + 4);
    if (![x, y, z, w].every((one) => typeof one === "number") || !isInMap([y, x])) continue;
    const yaw = 2 * Math.atan2(z, w);
    if (Number.isFinite(yaw)) found.push({ place: /** @type {Place} */ ([y, x]), yaw });
  }
  return found;
}

/**
 * Return the corners of the ellipse that contains the position with a probability of 95 %.
 *
 * @param {Place} place
 * @param {unknown} covariance the 36 numbers of a ROS pose, or the 4 numbers of x and y, in m²
 * @returns {Place[]} [] for another array or a matrix that is no covariance
 */
export function ellipseOf([y, x], covariance) {
  const list = Array.isArray(covariance) ? covariance : [];
  const wide = list.length === 36 ? 6 : list.length === 4 ? 2 : 0;
  const [xx, xy, yy] = [list[0], list[1], list[wide + 1]];
  if (!wide || ![xx, xy, yy].every((one) => typeof one === "number" && Number.isFinite(one))) return [];
  const middle = (xx + yy) / 2;
  const spread = Math.hypot((xx - yy) / 2, xy);
  const [long, short] = [middle + spread, middle - spread];
  if (!(long > 0) || short < -1e-9 * long) return [];
  const turn = Math.atan2(2 * xy, xx - yy) / 2;
  const [a, b] = [SIGMAS * Math.sqrt(long), SIGMAS * Math.sqrt(Math.max(0, short))];
  return Array.from({ length: CORNERS }, (_, corner) => {
    const angle = (corner / CORNERS) * 2 * Math.PI;
    const [u, v] = [a * Math.cos(angle), b * Math.sin(angle)];
    return [y + u * Math.sin(turn) + v * Math.cos(turn), x + u * Math.cos(turn) - v * Math.sin(turn)];
  });
}

/**
 * Return the points of an arrow on the robot's own map.
 *
 * @param {Place} place start of the arrow
 * @param {number} yaw direction in radians, counter-clockwise from the x axis
 * @param {number} length in metres
 * @returns {Place[]}
 */
export function arrowOf([y, x], yaw, length) {
  const at = (/** @type {number} */ along, /** @type {number} */ beside) =>
    /** @type {Place} */ ([
      y + length * (along * Math.sin(yaw) + beside * Math.cos(yaw)),
      x + length * (along * Math.cos(yaw) - beside * Math.sin(yaw)),
    ]);
  return [at(0, 0), at(1, 0), at(0.65, 0.28), at(1, 0), at(0.65, -0.28)];
}

/**
 * Return an angle between -π and π.
 *
 * @param {number} angle in radians
 */
export function wrapped(angle) {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}
