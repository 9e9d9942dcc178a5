// @ts-check
/**
 * Finds frames that do not answer, and the one to blame. Knows no DOM.
 *
 * A browser may run all frames without an origin in one process. Then one that never ends silences
 * the others with it, and nothing frees them while any of them is left: so all are taken out, the
 * one that was at work when it became silent is ended, and the others begin anew.
 *
 * @typedef {object} Watched
 * @property {boolean} isBusy It said that it begins something, and not that this has ended.
 * @property {boolean} isUp It can answer.
 * @property {boolean} isMounted
 * @property {number} strikes How often it was silent together with others.
 * @property {(n: number) => void} ping
 * @property {() => void} accuse It stopped answering: its cell becomes a card.
 * @property {() => void} leave It is taken out, to come back.
 * @property {() => void} enter It comes back.
 */

export const TICK_MS = 250;
/** Ticks without an answer, on a page that was not late itself. */
const SILENT_TICKS = 8;
/** Ticks without an answer that make a frame one of those who are silent with another. */
const QUIET_TICKS = 4;
/** A page that was held up for longer cannot tell who was late. */
const LATE_MS = 2 * TICK_MS;
/** So often a frame may be silent with others when nobody knows who is to blame. */
const MOST_STRIKES = 3;
/**
 * A browser keeps a process for a while for whoever comes next, also one that never ends: so long
 * nobody comes back, and longer each time that it was not enough.
 */
const PAUSE_TICKS = 12;
const MOST_PAUSE_TICKS = 48;
/** Ticks that one of those who come back has before the next one comes: to load, and to stand. */
const LOAD_TICKS = 40;
const STAND_TICKS = 8;

export class Watch {
  constructor() {
    /** Frame → ticks since it was asked something that it has not answered. @type {Map<Watched, number>} */
    this.waiting = new Map();
    /** Those who are to come back. @type {Watched[]} */
    this.queue = [];
    /** The one that has its turn. @type {Watched | null} */
    this.coming = null;
    this.turnTicks = 0;
    /** Ticks before the first of them comes back. */
    this.pauseTicks = 0;
    /** How long that will be when all are taken out the next time. */
    this.empty = PAUSE_TICKS;
    this.lastMs = -Infinity;
    this.asked = 0;
  }

  /** It begins to come up. @param {Watched} one */
  add(one) {
    this.waiting.set(one, 0);
  }

  /** It is gone, for good or to come back. @param {Watched} one */
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
   * To be called every TICK_MS, while the page can be seen.
   *
   * @param {number} nowMs
   */
  tick(nowMs) {
    const gapMs = nowMs - this.lastMs;
    this.lastMs = nowMs;
    if (gapMs > LATE_MS) return; // so were the frames, perhaps
    this.asked += 1;
    this.turn();
    for (const [one, ticks] of this.waiting) {
      if (!one.isUp) continue; // how long it takes to load, others look after
      this.waiting.set(one, ticks + 1);
      if (ticks === 0) one.ping(this.asked);
    }
    if ([...this.waiting.values()].some((ticks) => ticks > SILENT_TICKS)) this.judge();
  }

  /** Let the next one come back, when the one before it stands. */
  turn() {
    this.turnTicks += 1;
    if (this.turnTicks < this.pauseTicks) return;
    const { coming } = this;
    if (coming && !coming.isMounted) {
      if (this.turnTicks < (coming.isUp ? STAND_TICKS : LOAD_TICKS)) return;
      if (!coming.isUp && this.empty <= MOST_PAUSE_TICKS) {
        this.clear([]); // it was put where the last one never ends
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
   * Take all out, and let those who are not guilty come back after a while.
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
    // The others have answered, so it has a process of its own.
    if (silent.length === 1 && all.every(([one]) => one === silent[0] || one.isUp)) return;
    this.clear(guilty);
  }
}

/**
 * Return who is to blame: who is alone, who was at work, or who was only coming up.
 *
 * @param {Watched[]} silent
 * @returns {Watched[]} one at most
 */
function blamed(silent) {
  const busy = silent.filter(({ isBusy }) => isBusy);
  const coming = silent.filter(({ isMounted }) => !isMounted);
  return [silent, busy, coming].find(({ length }) => length === 1) ?? [];
}
