// @ts-check
/**
 * How many widgets are drawn in one frame. Knows no DOM.
 *
 * Where all that is new fits into a frame, all of it is drawn. On a device that is too slow for that,
 * widgets take turns, so that the frames keep coming: what is then drawn is the newest, and each has
 * its turn several times a second.
 *
 * On one that is too slow for half of them, widgets are drawn in every second frame only. To draw
 * anything at all costs the browser as much as several widgets, so more are drawn in a second in that
 * way; and every other frame is free for hands.
 */

/** The widgets' share of a frame: styles, layout and painting included; the rest is for hands. */
export const SHARE_MS = 8;
/** Their share of a frame whose next one is free. */
export const SHARE_OF_TWO_MS = 12;
/** In so many frames in which widgets are drawn each has its turn, however slow the device is. */
export const LONGEST_TURN = 10;
/** Fewer widgets than these never take turns: looking at what they cost would cost more. */
export const FEW = 8;
const FASTER = 1.1;
const SLOWER = 0.75;
/** What all of them may take in every second frame, in shares, before each frame is tried again. */
const NEARLY = 1.25;

export class Pace {
  constructor() {
    this.most = Infinity;
    /** Whether widgets are drawn in every second frame only. */
    this.isHalved = false;
    /** Whether the last frame drew widgets, and many had something new. */
    this.isLastFull = false;
  }

  /**
   * Begin a frame; return how many widgets may be drawn in it. In a free one nothing is, not even
   * what waits for no turn: all that is new has its frame with the next one.
   *
   * @param {number} count how many there are
   */
  begin(count) {
    if (this.isHalved && this.isLastFull) {
      this.isLastFull = false;
      return 0;
    }
    return Math.max(1, Math.ceil(count / LONGEST_TURN), Math.floor(this.most));
  }

  /**
   * End a frame that was not free; return whether it is worth learning from. Those that wait count as
   * well: where turns are short, few are drawn in each frame, and it could never be found out that
   * there is room for more.
   *
   * @param {number} drawn how many widgets it drew
   * @param {number} waiting how many wait for their turn
   */
  end(drawn, waiting) {
    this.isLastFull = drawn > 0 && drawn + waiting >= FEW;
    return this.isLastFull;
  }

  /**
   * Learn from a frame.
   *
   * @param {number} drawn how many widgets it drew, at least 1
   * @param {number} tookMs from its first callback to when it was painted
   * @param {number} count how many widgets there are
   */
  learn(drawn, tookMs, count) {
    const share = (this.isHalved ? SHARE_OF_TWO_MS : SHARE_MS) / Math.max(0.1, tookMs);
    if (share < 1) this.most = Math.min(this.most, drawn) * Math.max(SLOWER, share);
    else if (this.most < count) this.most *= Math.min(FASTER, share);
    else {
      this.most = Infinity;
      this.isHalved &&= tookMs > SHARE_MS * NEARLY;
    }
    this.isHalved ||= this.most < count / 2;
    this.most = Math.max(this.most, count / LONGEST_TURN);
  }
}
