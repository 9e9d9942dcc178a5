// @ts-check
/**
 * A canvas that shows whole bitmaps. The canvas keeps the size of each bitmap, and the browser scales it
 * when it composes the page. Without a graphics processor, drawing the bitmap at its screen size takes
 * much longer.
 */

export class Screen {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.screen = canvas.getContext("bitmaprenderer");
    this.pen = this.screen ? null : canvas.getContext("2d");
  }

  /**
   * Show a bitmap, which is empty afterwards.
   *
   * @param {ImageBitmap} bitmap
   * @returns {boolean} whether its size differs from the size of the previous bitmap
   */
  show(bitmap) {
    const { canvas, screen, pen } = this;
    const { width, height } = bitmap;
    const isOther = canvas.width !== width || canvas.height !== height;
    if (isOther) [canvas.width, canvas.height] = [width, height];
    if (screen) screen.transferFromImageBitmap(bitmap);
    else pen?.drawImage(bitmap, 0, 0);
    return isOther || canvas.style.width === "";
  }

  clear() {
    this.screen?.transferFromImageBitmap(null);
    this.pen?.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }
}
