// @ts-check
/**
 * Decoder for the images of the chosen camera, one at a time. The newest image replaces any waiting image.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Picture} Picture
 *
 * @typedef {object} Shown
 * @property {Blob} blob
 * @property {number} width pixels
 * @property {number} height
 */

export class Newest {
  /**
   * @param {(bitmap: ImageBitmap) => void} show shows an image, and may keep its bitmap
   * @param {(blob: Blob) => void} failed receives an image that cannot be decoded
   */
  constructor(show, failed) {
    this.show = show;
    this.failed = failed;
    /** @type {Picture | null} */
    this.next = null;
    this.serial = -1;
    this.isBusy = false;
    this.isOver = false;
    /** Number of the camera; images of earlier cameras are not shown. */
    this.source = 0;
    /** @type {Shown | null} */
    this.shown = null;
  }

  /** @param {Picture} picture */
  take(picture) {
    if (this.isOver || picture.serial === this.serial) return;
    this.serial = picture.serial;
    this.next = picture;
    if (!this.isBusy) void this.work();
  }

  async work() {
    this.isBusy = true;
    while (this.next && !this.isOver) {
      const { blob } = this.next;
      const { source } = this;
      this.next = null;
      try {
        const bitmap = await createImageBitmap(blob);
        if (this.isOver || source !== this.source) bitmap.close();
        else this.replace(bitmap, blob);
      } catch {
        if (!this.isOver && source === this.source) this.failed(blob);
      }
    }
    this.isBusy = false;
  }

  /**
   * @param {ImageBitmap} bitmap
   * @param {Blob} blob
   */
  replace(bitmap, blob) {
    this.shown = { blob, width: bitmap.width, height: bitmap.height };
    this.show(bitmap);
    bitmap.close();
  }

  /** Forget the present camera. */
  leave() {
    this.source += 1;
    this.serial = -1;
    this.next = null;
    this.shown = null;
  }

  end() {
    this.isOver = true;
    this.leave();
  }
}
