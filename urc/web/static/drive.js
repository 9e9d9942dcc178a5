// @ts-check
/**
 * Who has the controls, and STOP. Knows the socket and no widget.
 *
 * @typedef {import("./types.js").Lease} Lease
 * @typedef {import("./socket.js").Socket} Socket
 * @typedef {"take" | "ask" | "yes" | "no" | "force" | "leave" | "reset"} Verb
 * @typedef {"" | "sending" | "sent" | "failed"} StopPhase What is known of the last press of STOP,
 *   before the lease says that it is latched.
 */

/** Without a word of the server for so long, STOP goes the other way too. */
const STOP_AGAIN_MS = 300;
const POST_WITHIN_MS = 3000;

export class Drive {
  /**
   * @param {Socket} socket
   * @param {string} stopUrl where STOP goes when the socket is down
   * @param {() => void} changed something to show
   */
  constructor(socket, stopUrl, changed) {
    this.socket = socket;
    this.stopUrl = stopUrl;
    this.changed = changed;
    /** @type {Lease | null} */
    this.lease = null;
    /** Newest number that the server has told this page; 0 while it has not. */
    this.beat = 0;
    /** Counts the ticks of this page. */
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
   */
  setLease(lease, nowMs) {
    const wasMine = this.isMine;
    this.lease = lease;
    this.handedMs = nowMs + lease.left;
    if (!this.isMine) this.beat = 0;
    if (this.isMine !== wasMine || lease.latched) this.refusal = "";
    if (lease.latched || this.phase === "failed") this.settle("");
    this.posted = null;
    this.changed();
  }

  /** The page has lost the server: it holds nothing any more. */
  lost() {
    if (this.lease?.latched) {
      this.posted = { latched: this.lease.latched, confirmed: this.lease.confirmed };
    }
    this.lease = null;
    this.beat = 0;
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
    if (this.socket.send({ t: "stop" })) {
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
