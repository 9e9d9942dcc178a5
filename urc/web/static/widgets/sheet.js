// @ts-check
/**
 * A canvas that changes less often than the page around it: `import { Sheet } from "urc/sheet"`.
 *
 * Where a browser draws without a graphics processor, it copies each canvas that can be seen as often
 * as anything on the page changes, whether that canvas has changed or not. A finished picture that was
 * handed over it does not copy again. So this is drawn on out of sight, and shown when it is done.
 */

export class Sheet {
  /** @param {HTMLCanvasElement} canvas Shows it; nobody else may have drawn on it. */
  constructor(canvas) {
    this.canvas = canvas;
    const surface = typeof OffscreenCanvas === "function" ? new OffscreenCanvas(1, 1) : null;
    const hidden = surface?.getContext("2d") ?? null;
    const screen = hidden ? canvas.getContext("bitmaprenderer") : null;
    const pen = screen ? hidden : canvas.getContext("2d");
    if (!pen) throw new Error("this browser draws no canvas");
    this.screen = screen;
    this.surface = screen && surface ? surface : canvas;
    /** Draws on it. All that a canvas in the page can be drawn with, this one can be. */
    this.pen = /** @type {CanvasRenderingContext2D} */ (pen);
    this.isDue = false;
  }

  /**
   * Wipe it when it has another size now.
   *
   * @param {number} width pixels of the picture
   * @param {number} height
   */
  resize(width, height) {
    for (const one of [this.surface, this.canvas]) {
      if (one.width !== width) one.width = width;
      if (one.height !== height) one.height = height;
    }
  }

  /** Show it when the code that runs has ended: before the next frame is painted. */
  showSoon() {
    if (this.isDue) return;
    this.isDue = true;
    queueMicrotask(() => {
      this.isDue = false;
      this.show();
    });
  }

  /**
   * Show what was drawn.
   *
   * @param {boolean} [isKept] whether what is drawn next comes on top of it; else it begins empty
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
