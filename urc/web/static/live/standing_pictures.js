// @ts-check
/**
 * Videos whose picture stands still, although the encoder sends new data. `urc/runtime/standing_pictures.py`
 * explains the rule, and contains it for JPEG images of videos.
 *
 * @typedef {object} Keyframe A decoded keyframe of a video.
 * @property {number} number Number of its access unit.
 * @property {number} timeMs Time of the image on this page's clock.
 * @property {Uint32Array} blocks Checksum of each block, which includes the place of the block.
 *
 * @typedef {{number: number, timeMs: number}} First The first image of a standing picture.
 */

/** Number of remembered keyframes. An encoder at constant bit rate needs about ten to repeat one. */
const MOST_KEYFRAMES = 128;
/** Maximum share of new blocks in a keyframe of a standing picture. */
const NEW_SHARE = 1 / 8;
/** Number of new keyframes in sequence that end a standstill; a single one may have a new quality. */
const ENDS_AFTER = 2;

export class StandingPictures {
  constructor() {
    /** First and newest keyframe with each block, by its checksum. @type {Map<number, {first: First, newest: Keyframe}>} */
    this.blocks = new Map();
    /** Newest keyframes, in order. @type {Keyframe[]} */
    this.keyframes = [];
    /** First image of the standing picture; null while the picture changes. @type {First | null} */
    this.since = null;
    /** Number of new keyframes in sequence. */
    this.news = 0;
  }

  /** Compare a keyframe with the earlier ones. @param {Keyframe} keyframe */
  add(keyframe) {
    const { number, timeMs, blocks } = keyframe;
    const here = { number, timeMs };
    const firsts = [...blocks].map((block) => {
      const first = this.blocks.get(block)?.first ?? here;
      this.blocks.set(block, { first, newest: keyframe });
      return first;
    });
    this.keyframes.push(keyframe);
    if (this.keyframes.length > MOST_KEYFRAMES) this.forgetOldest();
    firsts.sort((one, other) => one.timeMs - other.timeMs);
    this.judge(firsts[Math.ceil(firsts.length * (1 - NEW_SHARE)) - 1] ?? here, timeMs);
  }

  /**
   * Take over a standing picture from another stream of the same camera, until new keyframes show motion. The
   * first keyframe of this stream shows nothing, because nothing is known to compare it with.
   *
   * @param {First} since
   */
  inherit(since) {
    if (!this.since || since.timeMs < this.since.timeMs) this.since = since;
    this.news = -1;
  }

  /**
   * @param {First} since
   * @param {number} timeMs
   */
  judge(since, timeMs) {
    if (since.timeMs < timeMs) {
      this.news = 0;
      if (!this.since || since.timeMs < this.since.timeMs) this.since = since;
      return;
    }
    this.news += 1;
    if (this.news >= ENDS_AFTER) this.since = null;
  }

  /**
   * Return the image that the camera repeats; null for a current image.
   *
   * @param {number} timeMs time of a decoded image
   * @param {number} afterMs time after which equal images count as one
   */
  first(timeMs, afterMs) {
    return this.since && timeMs - this.since.timeMs >= afterMs ? this.since : null;
  }

  forgetOldest() {
    const oldest = this.keyframes.shift();
    for (const block of oldest?.blocks ?? []) {
      if (this.blocks.get(block)?.newest === oldest) this.blocks.delete(block);
    }
  }
}
