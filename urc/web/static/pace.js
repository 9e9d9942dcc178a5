// @ts-check
/**
 * How many widgets are drawn in one frame. Knows no DOM.
 *
 * Where all that is new fits into a frame, all of it is drawn. On a device that is too slow for that,
 * widgets take turns, so that the frames keep coming: what is then drawn is the newest, and no widget
 * waits for more than a few frames.
 */

/** The widgets' share of a frame: styles, layout and painting included; the rest is for hands. */
export const SHARE_MS = 8;
/** In so many frames each widget has its turn, however slow the device is. */
export const LONGEST_TURN = 10;
/** Fewer widgets than these never take turns: looking at what they cost would cost more. */
export const FEW = 8;
const FASTER = 1.1;
const SLOWER = 0.75;

export class Pace {
  constructor() {
    this.most = Infinity;
  }

  /**
   * Return how many widgets may be drawn in this frame.
   *
   * @param {number} count how many there are
   */
  allowed(count) {
    return Math.max(1, Math.ceil(count / LONGEST_TURN), Math.floor(this.most));
  }

  /**
   * Return whether a frame is worth learning from. Those that wait count as well: where turns are
   * short, few are drawn in each frame, and it could never be found out that there is room for more.
   *
   * @param {number} drawn how many widgets it drew
   * @param {number} waiting how many wait for their turn
   */
  isTelling(drawn, waiting) {
    return drawn > 0 && drawn + waiting >= FEW;
  }

  /**
   * Learn from a frame.
   *
   * @param {number} drawn how many widgets it drew, at least 1
   * @param {number} tookMs from its first callback to when it was painted
   * @param {number} count how many widgets there are
   */
  learn(drawn, tookMs, count) {
    const share = SHARE_MS / Math.max(0.1, tookMs);
    if (share < 1) this.most = Math.min(this.most, drawn) * Math.max(SLOWER, share);
    else if (this.most < count) this.most *= Math.min(FASTER, share);
    else this.most = Infinity;
    this.most = Math.max(this.most, count / LONGEST_TURN);
  }
}
