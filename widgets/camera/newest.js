// @ts-check
/**
 * Decoder for the images of the chosen camera, one at a time: the newest wins, none is queued.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Picture} Picture
 */

export class Newest {
  /**
   * @param {(bitmap: ImageBitmap) => void} show shows an image; the bitmap stays open until the next one
   * @param {(error: unknown) => void} failed
   */
  constructor(show, failed) {
    this.show = show;
    this.failed = failed;
    /** @type {Picture | null} */
    this.next = null;
    this.serial = -1;
    this.isBusy = false;
    this.isOver = false;
    /** Number of the camera: images of an earlier one are not shown. */
    this.source = 0;
    /** @type {ImageBitmap | null} */
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
        else this.replace(bitmap);
      } catch (error) {
        if (!this.isOver && source === this.source) this.failed(error);
      }
    }
    this.isBusy = false;
  }

  /** @param {ImageBitmap} bitmap */
  replace(bitmap) {
    this.shown?.close();
    this.shown = bitmap;
    this.show(bitmap);
  }

  /** Forget the present camera. */
  leave() {
    this.source += 1;
    this.serial = -1;
    this.next = null;
    this.shown?.close();
    this.shown = null;
  }

  end() {
    this.isOver = true;
    this.leave();
  }
}
