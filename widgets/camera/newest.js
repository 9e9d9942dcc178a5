// @ts-check
/**
 * Decoder for the images of the chosen camera, one at a time. The newest image replaces any waiting image.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Picture} Picture
 *
 * @typedef {import("../../urc/web/static/core/types.js").VideoImage} VideoImage
 *
 * @typedef {object} Shown
 * @property {Blob | null} blob null for an image of a video
 * @property {number} width pixels
 * @property {number} height
 */

export class Newest {
  /**
   * @param {(bitmap: ImageBitmap, picture: Picture | VideoImage) => void} show shows an image, and may keep
   *   its bitmap
   * @param {(blob: Blob) => void} failed receives an image that cannot be decoded
   */
  constructor(show, failed) {
    this.show = show;
    this.failed = failed;
    /** @type {Picture | VideoImage | null} */
    this.next = null;
    this.serial = -1;
    this.isBusy = false;
    this.isOver = false;
    /** Number of the camera; images of earlier cameras are not shown. */
    this.source = 0;
    /** @type {Shown | null} */
    this.shown = null;
  }

  /** @param {Picture | VideoImage} picture */
  take(picture) {
    if (this.isOver || picture.serial === this.serial) return;
    this.serial = picture.serial;
    this.next = picture;
    if (!this.isBusy) void this.work();
  }

  async work() {
    this.isBusy = true;
    while (this.next && !this.isOver) {
      const picture = this.next;
      const blob = blobOf(picture);
      const { source } = this;
      this.next = null;
      try {
        const bitmap = await createImageBitmap("blob" in picture ? picture.blob : picture.bitmap);
        if (this.isOver || source !== this.source) bitmap.close();
        else this.replace(bitmap, picture);
      } catch {
        // A newer image of a video closes the earlier bitmap.
        if (blob && !this.isOver && source === this.source) this.failed(blob);
      }
    }
    this.isBusy = false;
  }

  /**
   * @param {ImageBitmap} bitmap
   * @param {Picture | VideoImage} picture
   */
  replace(bitmap, picture) {
    this.shown = { blob: blobOf(picture), width: bitmap.width, height: bitmap.height };
    this.show(bitmap, picture);
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

/** @param {Picture | VideoImage} picture */
function blobOf(picture) {
  return "blob" in picture ? picture.blob : null;
}
