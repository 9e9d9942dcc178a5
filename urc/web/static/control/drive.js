// @ts-check
/**
 * The lease and STOP of this page. The module uses the socket, and no widgets.
 *
 * @typedef {import("../core/types.js").Lease} Lease
 * @typedef {import("../live/socket.js").Socket} Socket
 * @typedef {"take" | "ask" | "yes" | "no" | "force" | "leave" | "reset" | "override"} Verb
 * @typedef {"" | "sending" | "sent" | "failed"} StopPhase State of the last press of STOP, until the
 *   lease reports the latch.
 */
import { request } from "../core/server.js";
import { RedundantSocket } from "./redundant_socket.js";

/** Time without messages from the server after which STOP is also sent over HTTP. */
const STOP_AGAIN_MS = 300;
const POST_WITHIN_MS = 3000;
/** Round-trip time above which packet loss takes too much time; see `RedundantSocket`. */
const FAR_MS = 40;
/** Interval between heartbeats that indicates loss or delay. */
const LATE_BEAT_MS = 150;
/** Time for which a link counts as lossy after a loss. */
const LOSSY_MS = 5000;
/**
 * Time after a tick in which the browser may not have reported its sending yet, so another tick may
 * follow. Browsers report sent data at low priority, after painting.
 */
const LEAVING_MS = 8;

export class Drive {
  /**
   * @param {Socket} socket
   * @param {string} stopUrl URL for STOP requests without a working socket
   * @param {() => void} changed callback for changes of the display
   * @param {string} [spareUrl] URL of the redundant socket
   */
  constructor(socket, stopUrl, changed, spareUrl = "") {
    this.socket = socket;
    this.stopUrl = stopUrl;
    this.changed = changed;
    /** @type {Lease | null} */
    this.lease = null;
    /**
     * Number of STOPs in the server's last message; null before the first message.
     *
     * @type {number | null}
     */
    this.stops = null;
    /**
     * Time of the latched STOP, in milliseconds since 1970 on this device's clock; null if STOP is
     * not latched, or if this page was not connected at that time.
     *
     * @type {number | null}
     */
    this.latchedAtMs = null;
    /** Newest heartbeat number from the server; 0 before the first heartbeat. */
    this.beat = 0;
    this.beatMs = 0;
    /** Time of the last late heartbeat, on this page's clock. */
    this.lateMs = -Infinity;
    /**
     * The newest tick as the robot's site received it; null at the robot's own site.
     *
     * @type {{age: number, percent: number} | null}
     */
    this.input = null;
    this.spare = new RedundantSocket(spareUrl, ({ n, input }) => this.hear(n, performance.now(), input));
    /** Time of the last tick that left the buffer empty. */
    this.freeMs = -Infinity;
    /** Counter of messages about held controls. */
    this.number = 0;
    /** @type {StopPhase} */
    this.phase = "";
    /** Response to STOP over HTTP. @type {{latched: string, confirmed: boolean} | null} */
    this.posted = null;
    /** Reason for refusing the last request about the controls. */
    this.refusal = "";
    /** Number of STOPs that the page knew at its own last press; null if it knew none. @type {number | null} */
    this.pressed = null;
    /** Time at which the asking page gets the controls, on this page's clock. */
    this.handedMs = 0;
    /** Time until which this page may drive without an image, on its clock. */
    this.overrideMs = 0;
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
   * @returns {boolean} whether STOP was pressed since the last lease, even if it is reset already
   */
  setLease(lease, nowMs) {
    const wasMine = this.isMine;
    const isStopped = this.stops !== null && lease.stops !== this.stops;
    this.witness(lease, isStopped);
    this.stops = lease.stops;
    this.lease = lease;
    this.handedMs = nowMs + lease.left;
    this.overrideMs = this.isMine ? nowMs + (lease.override ?? 0) : 0;
    if (!this.isMine) this.forgetBeat();
    if (this.isMine !== wasMine || lease.latched) this.refusal = "";
    // A latch from before the press is no answer to it.
    const isAnswered = Boolean(lease.latched) && (this.pressed === null || lease.stops !== this.pressed);
    const isOwed = this.phase === "failed" && !isAnswered;
    if (isAnswered) this.settle("");
    this.posted = null;
    this.double();
    if (isOwed) this.stop(); // pressed while the socket was down: sent now
    else this.changed();
    return isStopped;
  }

  /**
   * Note the time of a STOP. The time of a STOP before this page's connection is unknown.
   *
   * @param {Lease} lease the new lease
   * @param {boolean} isStopped whether STOP was pressed since the last lease
   */
  witness(lease, isStopped) {
    if (!lease.latched) this.latchedAtMs = null;
    else if (isStopped) this.latchedAtMs = this.lease === null ? null : Date.now();
  }

  /**
   * Accept a heartbeat number from either socket.
   *
   * @param {number} beat
   * @param {number} nowMs
   * @param {{age: number, percent: number} | null} [input] this page's newest tick
   */
  hear(beat, nowMs, input = null) {
    if (!this.isMine || beat <= this.beat) return;
    if (this.beat && nowMs - this.beatMs > LATE_BEAT_MS) this.lateMs = nowMs;
    this.beat = beat;
    this.beatMs = nowMs;
    this.input = input;
    this.double();
  }

  /** Forget the heartbeats of an earlier lease. */
  forgetBeat() {
    this.beat = this.beatMs = 0;
    this.input = null;
  }

  /** Whether the link to the server has recently lost or delayed data. */
  get isLossy() {
    return performance.now() - this.lateMs < LOSSY_MS;
  }

  /** Open a redundant socket if the link may delay data for longer than a lease. */
  double() {
    if (!this.isMine) this.spare.want("");
    else if ((this.socket.tripMs ?? 0) > FAR_MS || this.isLossy) this.spare.want(this.lease?.spare ?? "");
  }

  /** Whether a tick would be sent immediately. */
  get isFree() {
    return this.isClear || this.spare.isFree;
  }

  /** Whether the buffer of the first socket is empty. */
  get isClear() {
    return this.socket.unsent === 0 || performance.now() - this.freeMs < LEAVING_MS;
  }

  /**
   * Send a message about held controls on all sockets; send a tick only into an empty buffer.
   *
   * @param {Record<string, unknown>} message
   * @param {boolean} isTick
   * @returns {boolean} whether the browser accepted it
   */
  tell(message, isTick = false) {
    this.number += 1;
    const numbered = { ...message, number: this.number };
    const isClear = this.isClear;
    if (isTick && this.socket.unsent === 0) this.freeMs = performance.now();
    const isSent = (!isTick || isClear) && this.socket.send(numbered);
    return this.spare.send(numbered) || isSent;
  }

  /** Discard the lease after a loss of the connection to the server. */
  lost() {
    if (this.lease?.latched) {
      this.posted = { latched: this.lease.latched, confirmed: this.lease.confirmed };
    }
    this.lease = null;
    this.forgetBeat();
    this.overrideMs = 0;
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
   * @returns {boolean} whether the browser accepted it
   */
  say(verb) {
    this.refusal = "";
    // A reset must not undo a STOP that the operator has not seen.
    return this.socket.send({ t: "drive", verb, ...(verb === "reset" && { stops: this.stops }) });
  }

  /** Stop the robot: immediately over the socket, and over HTTP if the server does not react. */
  stop() {
    this.settle("sending");
    this.pressed = this.stops;
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
      const answer = await request(this.stopUrl, {
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
      // Also after an earlier STOP: the latch may have been reset while this page had no link.
      if (this.phase !== "") this.settle("failed");
    }
    this.changed();
  }

  /** @param {StopPhase} phase */
  settle(phase) {
    clearTimeout(this.timer);
    this.phase = phase;
  }
}
