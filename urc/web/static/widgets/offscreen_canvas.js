// @ts-check
/**
 * A canvas that changes less often than the page around it: `import { Sheet } from "urc/offscreen_canvas"`.
 *
 * A browser without a graphics processor copies each visible canvas whenever anything on the page
 * changes. It does not copy a finished bitmap, so this class draws offscreen and shows the result.
 */

export class Sheet {
  /** @param {HTMLCanvasElement} canvas canvas in the page, on which no other code has drawn */
  constructor(canvas) {
    this.canvas = canvas;
    const surface = typeof OffscreenCanvas === "function" ? new OffscreenCanvas(1, 1) : null;
    const hidden = surface?.getContext("2d") ?? null;
    const screen = hidden ? canvas.getContext("bitmaprenderer") : null;
    const pen = screen ? hidden : canvas.getContext("2d");
    if (!pen) throw new Error("this browser draws no canvas");
    this.screen = screen;
    this.surface = screen && surface ? surface : canvas;
    /** Drawing context of the offscreen canvas. */
    this.pen = /** @type {CanvasRenderingContext2D} */ (pen);
    this.isDue = false;
  }

  /**
   * Clear the canvas after a change of its size.
   *
   * @param {number} width pixels
   * @param {number} height
   */
  resize(width, height) {
    for (const one of [this.surface, this.canvas]) {
      if (one.width !== width) one.width = width;
      if (one.height !== height) one.height = height;
    }
  }

  /** Show the drawing at the end of the running code, before the next frame is painted. */
  showSoon() {
    if (this.isDue) return;
    this.isDue = true;
    queueMicrotask(() => {
      this.isDue = false;
      this.show();
    });
  }

  /**
   * Show the drawing.
   *
   * @param {boolean} [isKept] whether the next drawing adds to this one; otherwise, the canvas is
   *   cleared
   */
  show(isKept = false) {
    const { screen, surface, pen } = this;
    if (!screen || !("transferToImageBitmap" in surface)) return;
    const picture = surface.transferToImageBitmap();
    if (isKept) {
      pen.save();
      pen.setTransform(1, 0, 0, 1, 0, 0);
      pen.globalCompositeOperation = "copy";
      pen.drawImage(picture, 0, 0);
      pen.restore();
    }
    screen.transferFromImageBitmap(picture);
  }
}
