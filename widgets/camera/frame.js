// @ts-check
/**
 * The placement of an image in its box. Pure: no DOM.
 *
 * @typedef {"contain" | "cover" | "fill" | "ground" | "filled"} Fit "ground": as "contain", but enlarged where the
 *   image would take less than `LEAST_SHARE` of the box; "filled": as "cover". Both keep the lower edge.
 * @typedef {object} Size
 * @property {number} width
 * @property {number} height
 *
 * @typedef {object} Placement Transform of a canvas before it draws the image around 0, 0.
 * @property {number} x position of the middle
 * @property {number} y
 * @property {number} angle radians, clockwise
 * @property {number} width width of the drawn image before its rotation
 * @property {number} height
 * @property {number} flip -1 if it is mirrored
 */

/** Share of the background that an image takes at least. */
const LEAST_SHARE = 0.73;
/** Maximum enlargement for this share: three quarters of the image stay visible. */
const MOST_ZOOM = 4 / 3;

/**
 * @param {Size} picture
 * @param {Size} box
 * @param {{fit: Fit, rotate: number, mirror: boolean}} look
 * @returns {Placement}
 */
export function place(picture, box, { fit, rotate, mirror }) {
  const turns = ((Math.round(rotate / 90) % 4) + 4) % 4;
  const isLying = turns % 2 === 1;
  const [across, down] = isLying ? [picture.height, picture.width] : [picture.width, picture.height];
  const [wide, high] = [box.width / Math.max(1, across), box.height / Math.max(1, down)];
  const whole = Math.min(wide, high);
  const filled = Math.max(wide, high);
  const isFilled = fit === "cover" || fit === "filled";
  const scale = isFilled ? filled : fit === "ground" ? groundScale(whole, filled) : whole;
  const [scaleX, scaleY] = fit === "fill" ? [wide, high] : [scale, scale];
  const [width, height] = isLying
    ? [picture.width * scaleY, picture.height * scaleX]
    : [picture.width * scaleX, picture.height * scaleY];
  // The ground next to the robot is at the lower edge of the image, so the upper edge is lost.
  const lostPx = fit === "ground" || fit === "filled" ? Math.max(0, down * scaleY - box.height) : 0;
  return {
    x: box.width / 2,
    y: (box.height - lostPx) / 2,
    angle: (turns * Math.PI) / 2,
    width,
    height,
    flip: mirror ? -1 : 1,
  };
}

/**
 * Return the scale of an image that is whole, unless it would take too little of the background.
 *
 * @param {number} whole scale at which the whole image fits; it then takes the share `whole / filled` of its box
 * @param {number} filled scale at which the image fills its box
 */
function groundScale(whole, filled) {
  return Math.max(whole, Math.min(LEAST_SHARE * filled, MOST_ZOOM * whole));
}

/**
 * Return the drag of the view as pan and tilt from -1 to 1. The image follows the finger, so the camera
 * turns in the opposite direction. Pan is positive to the left (REP 103), tilt upwards.
 *
 * @param {{x: number, y: number, startX: number, startY: number}} hand
 * @param {Size} box
 */
export function lookOf(hand, box) {
  const reach = Math.max(1, Math.min(box.width, box.height) / 2);
  const share = (/** @type {number} */ way) => Math.round(Math.min(1, Math.max(-1, way / reach)) * 1000) / 1000 + 0;
  return { pan: share(hand.x - hand.startX), tilt: share(hand.y - hand.startY) };
}

/**
 * Return the age of an image as text, with tenths for small ages.
 *
 * @param {number} seconds
 */
export function ageText(seconds) {
  if (seconds < 10) return `${Math.max(0, seconds).toFixed(1)} s`;
  if (seconds < 60) return `${Math.floor(seconds)} s`;
  return seconds < 3600 ? `${Math.floor(seconds / 60)} min` : `${Math.floor(seconds / 3600)} h`;
}

/**
 * Return the file name of a snapshot, with characters that every file system accepts.
 *
 * @param {string} title
 * @param {Date} when
 */
export function fileName(title, when) {
  const plain = title.toLowerCase().replace(/[^a-z0-9]+/g, "-").replace(/^-+|-+$/g, "").slice(0, 40);
  const stamp = when.toISOString().replace(/[:.]/g, "-").slice(0, 19);
  return `${plain || "camera"}-${stamp}.png`;
}

/** Rate of the last few images, in images per second. */
export class Rate {
  constructor() {
    /** @type {number[]} */
    this.times = [];
  }

  /** @param {number} nowS */
  add(nowS) {
    this.times.push(nowS);
    if (this.times.length > 30) this.times.shift();
  }

  /** @param {number} nowS */
  perSecond(nowS) {
    const recent = this.times.filter((time) => time > nowS - 3);
    const first = recent[0];
    if (first === undefined || recent.length < 2) return 0;
    return (recent.length - 1) / Math.max(0.001, (recent.at(-1) ?? first) - first);
  }
}
