// @ts-check
/**
 * The page's WebSocket, which reconnects automatically and measures the round-trip time.
 *
 * A connection counts as up only while its pings get replies, because an unplugged cable causes no
 * event.
 *
 * @typedef {object} Listener
 * @property {(message: any) => void} message Handles messages from the server, in order.
 * @property {(data: ArrayBuffer) => void} [picture] Handles a binary message.
 * @property {(isUp: boolean) => void} state Called on every change of `isUp`.
 * @property {() => void} trip Called after each measurement of the round trip.
 */

import { openSocket } from "../core/server.js";

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 5000;
const PING_EVERY_MS = 1000;
/**
 * Ticks without a reply after which the connection counts as lost, about three seconds on a running
 * page. A blocked page has only one tick, and then reads the messages that have arrived meanwhile.
 */
const SILENT_TICKS = 3;
/** Reason for a socket that closes itself, because pings get no replies. */
const SILENT = "no answer";
/** Close code of a restarted server, which does not know browsers from earlier starts. */
const NOT_LET_IN = 4401;

export class Socket {
  /**
   * @param {string} url
   * @param {Listener} listener
   */
  constructor(url, listener) {
    this.url = url;
    this.listener = listener;
    /** Round-trip time in milliseconds; null while unknown. @type {number | null} */
    this.tripMs = null;
    /** Messages since the page was opened. */
    this.messages = 0;
    this.bytes = 0;
    /**
     * Offset from URC's clock to this device's clock, in milliseconds; null while unknown.
     *
     * @type {number | null}
     */
    this.skewMs = null;
    /** Lost connections and failed attempts since the last good connection. */
    this.failures = 0;
    /** The server's reason for closing the socket. */
    this.reason = "";
    /** Full text of the reason, which arrives before the close frame and its short text. */
    this.refused = "";
    this.isUp = false;
    /** Whether the user must first open the printed address. */
    this.isShutOut = false;
    /** @type {WebSocket | null} */
    this.line = null;
    this.waitMs = FIRST_WAIT_MS;
    this.isWanted = false;
    /** Time of the pending ping; 0 without a pending ping. */
    this.pingedMs = 0;
    /** Ticks since the pending ping. */
    this.silent = 0;
    /** @type {number | undefined} */
    this.retry = undefined;
    /** @type {number | undefined} */
    this.beat = undefined;
  }

  open() {
    this.isWanted = true;
    this.connect();
  }

  /** Close for good, until `open`. */
  close() {
    this.isWanted = false;
    this.lose("");
  }

  /** Skip the backoff, because the network or the page is available again. */
  hurry() {
    if (this.isWanted && !this.line) this.connect();
  }

  /**
   * @param {object} message
   * @returns {boolean} whether the browser accepted it
   */
  send(message) {
    // The browser may know that the socket is closing before the close event.
    if (!this.isUp || !this.line || this.line.readyState !== WebSocket.OPEN) return false;
    this.line.send(JSON.stringify(message));
    return true;
  }

  /** Reason for which the reachable server refuses the robot; "" without a refusal. */
  get refusal() {
    return this.isUp || this.isShutOut || this.reason === SILENT ? "" : this.reason;
  }

  /** Bytes in the browser's send buffer. */
  get unsent() {
    return this.line?.bufferedAmount ?? 0;
  }

  connect() {
    clearTimeout(this.retry);
    const line = openSocket(this.url);
    this.line = line;
    line.binaryType = "arraybuffer";
    this.pingedMs = performance.now(); // a hanging handshake times out like a missing pong
    this.silent = 0;
    clearInterval(this.beat);
    this.beat = window.setInterval(() => this.tick(), PING_EVERY_MS);
    line.addEventListener("message", (event) => {
      if (line === this.line) this.take(event.data);
    });
    line.addEventListener("close", (event) => {
      if (line !== this.line) return;
      this.isShutOut = event.code === NOT_LET_IN;
      this.lose(event.reason);
    });
  }

  /** @param {unknown} data */
  take(data) {
    this.messages += 1;
    this.bytes += data instanceof ArrayBuffer ? data.byteLength : String(data).length;
    if (data instanceof ArrayBuffer) this.listener.picture?.(data);
    if (typeof data !== "string") return;
    const message = JSON.parse(data);
    if (message.t === "hello") {
      this.waitMs = FIRST_WAIT_MS;
      this.reason = "";
      this.isShutOut = false;
      this.failures = 0;
      this.pingedMs = 0;
      this.isUp = true;
      this.listener.state(true);
      // The first ping waits for `tick`, because the page is slow at its start.
      this.listener.message(message);
    } else if (message.t === "error" && message.code === "refused") {
      this.refused = message.message;
      this.listener.message(message);
    } else if (message.t === "pong") {
      this.tripMs = performance.now() - message.c;
      this.pingedMs = 0;
      if (message.u) this.skewMs = Date.now() - message.u - this.tripMs / 2;
      this.listener.message(message);
      this.listener.trip();
    } else {
      this.listener.message(message);
    }
  }

  tick() {
    if (!this.pingedMs) {
      if (this.isUp) this.ping();
      return;
    }
    this.silent += 1;
    if (this.silent >= SILENT_TICKS) this.lose(SILENT);
  }

  ping() {
    this.pingedMs = performance.now();
    this.silent = 0;
    this.send({ t: "ping", c: this.pingedMs });
  }

  /** @param {string} reason */
  lose(reason) {
    const line = this.line;
    this.line = null;
    clearInterval(this.beat);
    clearTimeout(this.retry);
    if (line && line.readyState <= WebSocket.OPEN) line.close();
    this.tripMs = null;
    this.reason = this.refused || reason;
    this.refused = "";
    this.isUp = false;
    this.failures += 1;
    this.listener.state(false);
    if (!this.isWanted) return;
    // Jitter, so that many pages do not reconnect at the same moment.
    this.retry = window.setTimeout(() => this.connect(), this.waitMs * (0.8 + 0.4 * Math.random()));
    this.waitMs = Math.min(this.waitMs * 2, LONGEST_WAIT_MS);
  }
}
