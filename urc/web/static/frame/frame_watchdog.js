// @ts-check
/**
 * The watchdog for frames, which finds unresponsive frames and the frame at fault. The module uses
 * no DOM.
 *
 * A browser may run all frames without an origin in one process. An endless loop in one frame then
 * blocks all frames, and the process exists as long as any of them. All frames are therefore
 * removed. The frame that was working ends, and the others restart.
 *
 * @typedef {object} Watched
 * @property {boolean} isBusy Whether the frame has reported the start of work without its end.
 * @property {boolean} isUp Whether it can respond.
 * @property {boolean} isMounted
 * @property {number} strikes Number of times that the frame was silent together with others.
 * @property {(n: number) => void} ping
 * @property {() => void} accuse Ends it, because it stopped responding: its cell shows a card.
 * @property {() => void} leave Removes it for a restart.
 * @property {() => void} enter Restarts it.
 */

export const TICK_MS = 250;
/** Ticks without a response after which a frame is silent, on a page that was not delayed. */
const SILENT_TICKS = 8;
/** Ticks without a response after which a frame counts as silent together with others. */
const QUIET_TICKS = 4;
/** Delay of the page itself above which a tick is not evidence. */
const LATE_MS = 2 * TICK_MS;
/** Number of times that a frame may be silent together with others without a known culprit. */
const MOST_STRIKES = 3;
/**
 * Pause before restarts. A browser may reuse a blocked process for a while, so the pause increases
 * whenever it was too short.
 */
const PAUSE_TICKS = 12;
const MOST_PAUSE_TICKS = 48;
/** Ticks for loading and mounting one frame before the next frame restarts. */
const LOAD_TICKS = 40;
const STAND_TICKS = 8;

export class FrameWatchdog {
  constructor() {
    /** Ticks since each frame's first unanswered ping. @type {Map<Watched, number>} */
    this.waiting = new Map();
    /** Frames that wait for a restart. @type {Watched[]} */
    this.queue = [];
    /** The frame that is restarting. @type {Watched | null} */
    this.coming = null;
    this.turnTicks = 0;
    /** Remaining ticks of the pause. */
    this.pauseTicks = 0;
    /** Length of the next pause, in ticks. */
    this.empty = PAUSE_TICKS;
    this.lastMs = -Infinity;
    this.asked = 0;
  }

  /** Add a frame at its start. @param {Watched} one */
  add(one) {
    this.waiting.set(one, 0);
  }

  /** Remove a frame. @param {Watched} one */
  remove(one) {
    this.waiting.delete(one);
    this.queue = this.queue.filter((other) => other !== one);
    if (this.coming === one) this.coming = null;
  }

  /** @param {Watched} one */
  answered(one) {
    if (this.waiting.has(one)) this.waiting.set(one, 0);
  }

  /**
   * Check all frames; called every TICK_MS while the page is visible.
   *
   * @param {number} nowMs
   */
  tick(nowMs) {
    const gapMs = nowMs - this.lastMs;
    this.lastMs = nowMs;
    if (gapMs > LATE_MS) return; // the frames may have been delayed, too
    this.asked += 1;
    this.turn();
    for (const [one, ticks] of this.waiting) {
      if (!one.isUp) continue; // loading has its own time limit
      this.waiting.set(one, ticks + 1);
      if (ticks === 0) one.ping(this.asked);
    }
    if ([...this.waiting.values()].some((ticks) => ticks > SILENT_TICKS)) this.judge();
  }

  /** Restart the next frame once the previous frame is mounted. */
  turn() {
    this.turnTicks += 1;
    if (this.turnTicks < this.pauseTicks) return;
    const { coming } = this;
    if (coming && !coming.isMounted) {
      if (this.turnTicks < (coming.isUp ? STAND_TICKS : LOAD_TICKS)) return;
      if (!coming.isUp && this.empty <= MOST_PAUSE_TICKS) {
        this.clear([]); // the browser put it into the blocked process
        return;
      }
    }
    this.coming = this.queue.shift() ?? null;
    this.turnTicks = 0;
    this.pauseTicks = 0;
    if (!this.coming) this.empty = PAUSE_TICKS;
    this.coming?.enter();
  }

  /**
   * Remove all frames, and restart the frames without fault after a pause.
   *
   * @param {Watched[]} guilty
   */
  clear(guilty) {
    const others = [...this.waiting.keys(), ...this.queue].filter((one) => !guilty.includes(one));
    for (const one of others) one.leave();
    this.queue = others;
    this.coming = null;
    this.turnTicks = 0;
    this.pauseTicks = this.empty;
    this.empty *= 2;
  }

  judge() {
    const all = [...this.waiting];
    const silent = all.filter(([, ticks]) => ticks > QUIET_TICKS).map(([one]) => one);
    const guilty = blamed(silent);
    if (guilty.length === 0) for (const one of silent) one.strikes += 1;
    guilty.push(...silent.filter((one) => one.strikes >= MOST_STRIKES && !guilty.includes(one)));
    for (const one of guilty) one.accuse();
    // The others have responded, so this frame has its own process.
    if (silent.length === 1 && all.every(([one]) => one === silent[0] || one.isUp)) return;
    this.clear(guilty);
  }
}

/**
 * Return the frame at fault: the only one, the one at work, or the one that is starting.
 *
 * @param {Watched[]} silent
 * @returns {Watched[]} at most one
 */
function blamed(silent) {
  const busy = silent.filter(({ isBusy }) => isBusy);
  const coming = silent.filter(({ isMounted }) => !isMounted);
  return [silent, busy, coming].find(({ length }) => length === 1) ?? [];
}
