// @ts-check
/**
 * Who has the controls, and STOP. Knows the socket and no widget.
 *
 * @typedef {import("../core/types.js").Lease} Lease
 * @typedef {import("../live/socket.js").Socket} Socket
 * @typedef {"take" | "ask" | "yes" | "no" | "force" | "leave" | "reset"} Verb
 * @typedef {"" | "sending" | "sent" | "failed"} StopPhase What is known of the last press of STOP,
 *   before the lease says that it is latched.
 */
import { Spare } from "./spare.js";

/** Without a word of the server for so long, STOP goes the other way too. */
const STOP_AGAIN_MS = 300;
const POST_WITHIN_MS = 3000;
/** A way there and back that takes longer makes what is lost on it cost too much time: see `Spare`. */
const FAR_MS = 40;
/** So much later than the one before it, a beat was lost on the way, or held up. */
const LATE_BEAT_MS = 150;
/** For so long a link that has lost something counts as one that does. */
const LOSSY_MS = 5000;
/**
 * So long after a tick the browser need not have noted yet that it has left: until then another may
 * follow. It notes that when it has nothing better to do, such as painting.
 */
const LEAVING_MS = 8;

export class Drive {
  /**
   * @param {Socket} socket
   * @param {string} stopUrl where STOP goes when the socket is down
   * @param {() => void} changed something to show
   * @param {string} [spareUrl] where a second line goes
   */
  constructor(socket, stopUrl, changed, spareUrl = "") {
    this.socket = socket;
    this.stopUrl = stopUrl;
    this.changed = changed;
    /** @type {Lease | null} */
    this.lease = null;
    /** How often STOP was pressed, as the server said last; null while it has not. @type {number | null} */
    this.stops = null;
    /** Newest number that the server has told this page; 0 while it has not. */
    this.beat = 0;
    this.beatMs = 0;
    /** When a beat came late, on this page's clock. */
    this.lateMs = -Infinity;
    this.spare = new Spare(spareUrl, (message) => this.hear(message.n, performance.now()));
    /** When a tick went out last with nothing before it. */
    this.freeMs = -Infinity;
    /** Counts what this page says of held controls. */
    this.number = 0;
    /** @type {StopPhase} */
    this.phase = "";
    /** What the server said when STOP went the other way. @type {{latched: string, confirmed: boolean} | null} */
    this.posted = null;
    /** Why the last wish about the controls was not granted. */
    this.refusal = "";
    /** When the asker gets the controls, on this page's clock. */
    this.handedMs = 0;
    /** @type {number | undefined} */
    this.timer = undefined;
  }

  get isMine() {
    return this.lease !== null && this.lease.holder?.id === this.lease.you;
  }

  get isLatched() {
    return Boolean(this.lease ? this.lease.latched : this.posted?.latched);
  }

  get isConfirmed() {
    return this.isLatched && Boolean(this.lease ? this.lease.confirmed : this.posted?.confirmed);
  }

  /**
   * @param {Lease} lease
   * @param {number} nowMs
   * @returns {boolean} whether STOP was pressed since the last one, be it that it is reset already
   */
  setLease(lease, nowMs) {
    const wasMine = this.isMine;
    const isStopped = this.stops !== null && lease.stops !== this.stops;
    this.stops = lease.stops;
    this.lease = lease;
    this.handedMs = nowMs + lease.left;
    if (!this.isMine) this.beat = this.beatMs = 0;
    if (this.isMine !== wasMine || lease.latched) this.refusal = "";
    const isOwed = this.phase === "failed" && !lease.latched;
    if (lease.latched) this.settle("");
    this.posted = null;
    this.double();
    if (isOwed) this.stop(); // pressed when nobody could be told: it is told now
    else this.changed();
    return isStopped;
  }

  /**
   * A number of the server, on either line.
   *
   * @param {number} beat
   * @param {number} nowMs
   */
  hear(beat, nowMs) {
    if (!this.isMine || beat <= this.beat) return;
    if (this.beat && nowMs - this.beatMs > LATE_BEAT_MS) this.lateMs = nowMs;
    this.beat = beat;
    this.beatMs = nowMs;
    this.double();
  }

  /** Whether the way to the server has lost or held up something just now. */
  get isLossy() {
    return performance.now() - this.lateMs < LOSSY_MS;
  }

  /** Have a second line where the first one may be held up for longer than a lease. */
  double() {
    if (!this.isMine) this.spare.want("");
    else if ((this.socket.tripMs ?? 0) > FAR_MS || this.isLossy) this.spare.want(this.lease?.spare ?? "");
  }

  /** Whether a tick would go out at once. */
  get isFree() {
    return this.isClear || this.spare.isFree;
  }

  /** Whether nothing waits on the first line. */
  get isClear() {
    return this.socket.unsent === 0 || performance.now() - this.freeMs < LEAVING_MS;
  }

  /**
   * Say something of held controls on every line; a tick only where nothing waits before it.
   *
   * @param {Record<string, unknown>} message
   * @param {boolean} isTick
   * @returns {boolean} whether it was handed to the browser
   */
  tell(message, isTick = false) {
    this.number += 1;
    const numbered = { ...message, number: this.number };
    const isClear = this.isClear;
    if (isTick && this.socket.unsent === 0) this.freeMs = performance.now();
    const isSent = (!isTick || isClear) && this.socket.send(numbered);
    return this.spare.send(numbered) || isSent;
  }

  /** The page has lost the server: it holds nothing any more. */
  lost() {
    if (this.lease?.latched) {
      this.posted = { latched: this.lease.latched, confirmed: this.lease.confirmed };
    }
    this.lease = null;
    this.beat = this.beatMs = 0;
    this.double();
    this.changed();
  }

  /** @param {string} message */
  refused(message) {
    this.refusal = message;
    this.changed();
  }

  /**
   * @param {Verb} verb
   * @returns {boolean} whether it was handed to the browser
   */
  say(verb) {
    this.refusal = "";
    return this.socket.send({ t: "drive", verb });
  }

  /** Stop the robot: at once, by the socket, and by a request of its own where that says nothing. */
  stop() {
    this.settle("sending");
    if (this.tell({ t: "stop" })) {
      this.phase = "sent";
      this.timer = window.setTimeout(() => void this.post(), STOP_AGAIN_MS);
    } else {
      void this.post();
    }
    this.changed();
  }

  async post() {
    try {
      const answer = await fetch(this.stopUrl, {
        method: "POST",
        keepalive: true,
        signal: AbortSignal.timeout(POST_WITHIN_MS),
      });
      if (!answer.ok) throw new Error(`the server said ${answer.status}`);
      const said = await answer.json();
      if (!this.lease) this.posted = { latched: said.latched, confirmed: said.confirmed };
      if (this.phase !== "") this.settle("");
    } catch (error) {
      console.warn("URC: STOP could not be delivered:", error);
      if (!this.isLatched) this.settle("failed");
    }
    this.changed();
  }

  /** @param {StopPhase} phase */
  settle(phase) {
    clearTimeout(this.timer);
    this.phase = phase;
  }
}
