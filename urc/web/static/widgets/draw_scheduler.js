// @ts-check
/**
 * The number of widgets drawn in one frame. The module uses no DOM.
 *
 * If one frame is enough, all changed widgets are drawn. On slower devices, widgets take turns to
 * preserve the frame rate, and each draws its newest values several times a second.
 *
 * On a device that is too slow for half of them, widgets are drawn in every second frame only. The
 * first change in a frame costs the browser as much time as several widgets. More widgets are
 * therefore drawn per second this way, and every other frame is free for input.
 */

/**
 * The widgets' share of a frame, including styles, layout and painting; the remaining time is for
 * input.
 */
export const SHARE_MS = 8;
/** The widgets' share of a frame before a free one. */
export const SHARE_OF_TWO_MS = 12;
/** Maximum number of drawing frames until each widget has had its turn, on any device. */
export const LONGEST_TURN = 10;
/** Number of widgets below which there are no turns, because measuring would take more time. */
export const FEW = 8;
const FASTER = 1.1;
const SLOWER = 0.75;
/** Load of all widgets in every second frame below which every frame is tried again, as a share. */
const NEARLY = 1.25;

export class DrawScheduler {
  constructor() {
    this.most = Infinity;
    /** Whether widgets are drawn in every second frame only. */
    this.isHalved = false;
    /** Whether the last frame drew widgets, and many had news. */
    this.isLastFull = false;
  }

  /**
   * Begin a frame; return the number of widgets to draw. In a free frame, no widget is drawn. Even
   * urgent changes wait for the next frame.
   *
   * @param {number} count number of widgets
   */
  begin(count) {
    if (this.isHalved && this.isLastFull) {
      this.isLastFull = false;
      return 0;
    }
    return Math.max(1, Math.ceil(count / LONGEST_TURN), Math.floor(this.most));
  }

  /**
   * End a drawing frame; return whether its duration is useful for learning. Waiting widgets count,
   * too. With short turns, few widgets are drawn in each frame, so a larger budget could otherwise
   * never be found.
   *
   * @param {number} drawn number of drawn widgets
   * @param {number} waiting number of widgets that wait for their turn
   */
  end(drawn, waiting) {
    this.isLastFull = drawn > 0 && drawn + waiting >= FEW;
    return this.isLastFull;
  }

  /**
   * Learn the cost of widgets from a frame.
   *
   * @param {number} drawn number of drawn widgets, at least 1
   * @param {number} tookMs time from its first callback to its painting
   * @param {number} count number of widgets
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
