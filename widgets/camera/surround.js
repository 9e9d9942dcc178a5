// @ts-check
/**
 * What surrounds an image that is narrower or lower than the page behind which it lies: two strips of
 * the image itself, enlarged and dimmed, so that they cannot be mistaken for a part of the image. Each
 * strip fades out over the edge of the image, so that no hard line runs through the page.
 */
import { place } from "./frame.js";

/** Width of the soft edge over the image, in pixels of the page. */
const SOFT_PX = 48;
/** Pixels of the page per pixel of a strip, which the browser enlarges smoothly: that is the blur. */
const STEP_PX = 16;
/** Share of black over the copy of the image. */
const DIM = 0.6;
/** Minimum time between two copies. They follow the image slowly, which costs little. */
const SOONEST_MS = 250;

/**
 * @typedef {import("./frame.js").Size} Size
 * @typedef {{left: number, top: number, width: number, height: number}} Box in pixels of the page
 */

/**
 * Return the boxes of both strips, each as wide as the empty side, the soft edge, and one step without
 * the copy; none if the image fills the page.
 *
 * @param {Size} page
 * @param {Size} image the image on the page, in its middle
 * @returns {[Box, Box] | null}
 */
export function strips(page, image) {
  const { width, height } = page;
  const [across, down] = [(width - image.width) / 2, (height - image.height) / 2];
  const over = SOFT_PX + STEP_PX;
  if (across > 0.5) {
    const wide = Math.min(across + over, width / 2);
    return [
      { left: 0, top: 0, width: wide, height },
      { left: width - wide, top: 0, width: wide, height },
    ];
  }
  if (down > 0.5) {
    const high = Math.min(down + over, height / 2);
    return [
      { left: 0, top: 0, width, height: high },
      { left: 0, top: height - high, width, height: high },
    ];
  }
  return null;
}

export class Surround {
  /** @param {readonly HTMLCanvasElement[]} canvases one for each side */
  constructor(canvases) {
    this.canvases = canvases;
    /** @type {[Box, Box] | null} */
    this.boxes = null;
    /** @type {Size} */
    this.page = { width: 0, height: 0 };
    this.copiedMs = -Infinity;
  }

  /**
   * Place the strips next to the image.
   *
   * @param {Size} page
   * @param {Size | null} image the image on the page; null if nothing surrounds it
   */
  lay(page, image) {
    const boxes = image && strips(page, image);
    this.page = page;
    if (JSON.stringify(boxes) === JSON.stringify(this.boxes)) return;
    this.boxes = boxes;
    this.copiedMs = -Infinity;
    this.canvases.forEach((canvas, side) => {
      const box = boxes?.[side];
      canvas.hidden = !box;
      if (!box) return;
      const { left, top, width, height } = box;
      Object.assign(canvas.style, { left: `${left}px`, top: `${top}px`, width: `${width}px`, height: `${height}px` });
      [canvas.width, canvas.height] = [Math.max(2, Math.round(width / STEP_PX)), Math.max(2, Math.round(height / STEP_PX))];
    });
  }

  /**
   * Copy the image, unless the last copy is new.
   *
   * @param {HTMLCanvasElement} picture
   * @param {{rotate: number, mirror: boolean}} look
   */
  follow(picture, look) {
    const nowMs = performance.now();
    const { boxes } = this;
    if (!boxes || picture.width === 0 || nowMs - this.copiedMs < SOONEST_MS) return;
    this.copiedMs = nowMs;
    this.canvases.forEach((canvas, side) => {
      const box = boxes[side];
      const pen = canvas.getContext("2d");
      if (!box || !pen) return;
      this.copy(pen, box, picture, look);
      fade(pen, box, this.page);
    });
  }

  /**
   * Draw the part of the enlarged, dimmed image that is in a strip.
   *
   * @param {CanvasRenderingContext2D} pen
   * @param {Box} box
   * @param {HTMLCanvasElement} picture
   * @param {{rotate: number, mirror: boolean}} look
   */
  copy(pen, box, picture, { rotate, mirror }) {
    const { x, y, angle, width, height, flip } = place(picture, this.page, { fit: "fill", rotate, mirror });
    const [across, down] = [pen.canvas.width / box.width, pen.canvas.height / box.height];
    pen.globalCompositeOperation = "source-over";
    // The flip is in front of the rotation, as for the image itself.
    pen.setTransform(flip * across, 0, 0, down, (x - box.left) * across, (y - box.top) * down);
    pen.rotate(angle);
    pen.drawImage(picture, -width / 2, -height / 2, width, height);
    pen.setTransform(across, 0, 0, down, 0, 0);
    pen.fillStyle = `rgb(0 0 0 / ${DIM})`;
    pen.fillRect(0, 0, box.width, box.height);
  }
}

/**
 * Make a strip transparent towards the middle of the page.
 *
 * @param {CanvasRenderingContext2D} pen in pixels of the strip's box
 * @param {Box} box
 * @param {Size} page
 */
function fade(pen, box, page) {
  const isLying = box.width === page.width;
  const long = isLying ? box.height : box.width;
  const isFirst = (isLying ? box.top : box.left) === 0;
  // A step inside the image's edge: the browser mixes neighbouring pixels, and the edge must not show.
  const end = long - STEP_PX;
  const [from, to] = isFirst ? [end - SOFT_PX + STEP_PX, end] : [SOFT_PX, STEP_PX];
  const shade = isLying ? pen.createLinearGradient(0, from, 0, to) : pen.createLinearGradient(from, 0, to, 0);
  shade.addColorStop(0, "transparent");
  shade.addColorStop(1, "black");
  pen.globalCompositeOperation = "destination-out";
  pen.fillStyle = shade;
  pen.fillRect(0, 0, box.width, box.height);
}
