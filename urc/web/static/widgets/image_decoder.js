// @ts-check
/**
 * Decoder for the images of one input, at the speed of the device. Only the newest image is
 * decoded; no image is queued.
 *
 * @typedef {import("../core/types.js").Picture} Picture
 */

export class Decoder {
  /**
   * @param {(bitmap: ImageBitmap, picture: Picture) => void} show Shows an image. The bitmap is closed
   *   after the next one is shown.
   * @param {(error: unknown, picture: Picture) => void} failed Handles an image that cannot be decoded.
   * @param {(blob: Blob) => Promise<ImageBitmap>} [decode]
   */
  constructor(show, failed, decode = (blob) => createImageBitmap(blob)) {
    this.show = show;
    this.failed = failed;
    this.decode = decode;
    /** Newest image that arrived during decoding. @type {Picture | null} */
    this.next = null;
    this.isBusy = false;
    this.isOver = false;
    this.serial = 0;
    /** @type {ImageBitmap | null} */
    this.shown = null;
  }

  /** @param {Picture} picture */
  take(picture) {
    if (this.isOver || picture.serial <= this.serial) return;
    this.serial = picture.serial;
    this.next = picture;
    if (!this.isBusy) void this.work();
  }

  async work() {
    this.isBusy = true;
    while (this.next && !this.isOver) {
      const picture = this.next;
      this.next = null;
      try {
        const bitmap = await this.decode(picture.blob);
        if (this.isOver) bitmap.close();
        else this.replace(bitmap, picture);
      } catch (error) {
        this.failed(error, picture);
      }
    }
    this.isBusy = false;
  }

  /**
   * @param {ImageBitmap} bitmap
   * @param {Picture} picture
   */
  replace(bitmap, picture) {
    const old = this.shown;
    this.shown = bitmap;
    try {
      this.show(bitmap, picture);
    } finally {
      old?.close();
    }
  }

  end() {
    this.isOver = true;
    this.next = null;
    this.shown?.close();
    this.shown = null;
  }
}
