// @ts-check
/**
 * What surrounds an image that is narrower or lower than the page behind which it lies: the image
 * itself, enlarged, blurred and dimmed, so that it cannot be mistaken for a part of the image.
 */
import { place } from "./frame.js";

/** Pixels of the small copy, which the browser enlarges smoothly: that is the blur. */
const [WIDTH, HEIGHT] = [24, 18];
/** Minimum time between two copies. They follow the image slowly, which costs little. */
const SOONEST_MS = 250;

export class Surround {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    [canvas.width, canvas.height] = [WIDTH, HEIGHT];
    this.pen = canvas.getContext("2d");
    this.copiedMs = -Infinity;
  }

  /** @param {boolean} isNeeded whether anything of the page is next to the image */
  need(isNeeded) {
    if (this.canvas.hidden === !isNeeded) return;
    this.canvas.hidden = !isNeeded;
    this.copiedMs = -Infinity;
  }

  /**
   * Copy the image, unless the last copy is new.
   *
   * @param {HTMLCanvasElement} picture
   * @param {{rotate: number, mirror: boolean}} look
   */
  follow(picture, { rotate, mirror }) {
    const nowMs = performance.now();
    if (this.canvas.hidden || !this.pen || picture.width === 0 || nowMs - this.copiedMs < SOONEST_MS) return;
    this.copiedMs = nowMs;
    const { x, y, angle, width, height, flip } = place(picture, { width: WIDTH, height: HEIGHT }, { fit: "fill", rotate, mirror });
    this.pen.setTransform(flip, 0, 0, 1, x, y); // in front of the rotation, as for the image itself
    this.pen.rotate(angle);
    this.pen.drawImage(picture, -width / 2, -height / 2, width, height);
  }
}
