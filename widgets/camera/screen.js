// @ts-check
/**
 * A canvas that shows whole bitmaps. It takes each bitmap as it is, and the browser scales it when it
 * composes the page: drawing it in its size on the screen costs many times as much without a graphics
 * processor.
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
   * @returns {boolean} whether its size differs from the size of the last one
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
