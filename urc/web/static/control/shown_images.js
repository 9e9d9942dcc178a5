// @ts-check
/**
 * The images that this page shows, for commands that require the operator to see one.
 *
 * With each tick of such a command, the page names the image that it shows and for how long it has shown it.
 * The server computes the age of the image on its own clock. The ages here only explain to the operator why
 * a robot moves slowly or not at all.
 *
 * @typedef {object} Sight Image that a command requires, and the limits of its age.
 * @property {string} signal
 * @property {number | null} slowMs Age at which the permitted speed begins to fall; null if it does not fall.
 * @property {number} stopMs Age at which the motion ends.
 *
 * @typedef {object} Numbered An image from the server.
 * @property {string} signal
 * @property {number} number Number of the image, from its message.
 * @property {number} timeMs Time of the image on this page's clock.
 * @property {number | undefined} [firstNumber] Number of the earlier image that the camera repeats in this one.
 */

export class ShownImages {
  constructor() {
    /** Newest shown image of each signal. @type {Map<string, Numbered & {atMs: number}>} */
    this.images = new Map();
  }

  /**
   * Record that a widget has drawn an image.
   *
   * @param {Numbered} image
   * @param {number} nowMs
   */
  show({ signal, number, timeMs, firstNumber }, nowMs) {
    const known = this.images.get(signal);
    if (known?.number === number) return;
    // Of two widgets with the same camera, the one with the newer image counts. A newer image can have an
    // earlier time: the camera may repeat its last image. Numbers begin again at 2^32.
    const isBehind = known && ((number - known.number) | 0) < 0;
    if (isBehind && known.timeMs > timeMs) return;
    this.images.set(signal, { signal, number, timeMs, firstNumber, atMs: nowMs });
  }

  /** Forget all images, because a new connection numbers them anew. */
  clear() {
    this.images.clear();
  }

  /**
   * Return what a tick reports: the number of the image, and for how long it has been shown, in milliseconds.
   * An image that the camera repeats is as old as the first one, so the first one is named.
   *
   * @param {string} signal
   * @param {number} nowMs
   * @returns {[number, number] | undefined} undefined if no image is shown
   */
  report(signal, nowMs) {
    const image = this.images.get(signal);
    return image && [image.firstNumber ?? image.number, Math.max(0, Math.floor(nowMs - image.atMs))];
  }

  /**
   * Return the share of the requested speed that the shown image permits, from 0 to 1.
   *
   * @param {Sight} sight
   * @param {number} nowMs
   */
  share({ signal, slowMs, stopMs }, nowMs) {
    const image = this.images.get(signal);
    const ageMs = image ? nowMs - image.timeMs : Infinity;
    if (ageMs >= stopMs) return 0;
    return slowMs === null || ageMs <= slowMs ? 1 : (stopMs - ageMs) / (stopMs - slowMs);
  }
}
