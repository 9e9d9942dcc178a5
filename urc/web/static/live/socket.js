// @ts-check
/**
 * The page's one WebSocket: reconnects by itself, and measures the way there and back.
 *
 * A connection is only believed while its pings are answered: a cable that is pulled says nothing.
 *
 * @typedef {object} Listener
 * @property {(message: any) => void} message A message of the server, in order.
 * @property {(data: ArrayBuffer) => void} [picture] A binary message.
 * @property {(isUp: boolean) => void} state Called on every change of `isUp`.
 * @property {() => void} trip A new round trip was measured.
 */

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 5000;
const PING_EVERY_MS = 1000;
/** So many ticks in a row may find no answer: three seconds, of a page that runs. A page that was
 * held up has had one tick only, however long that was, and then reads what has come meanwhile. */
const SILENT_TICKS = 3;
/** How a server that was started again closes: it knows no browser of before. */
const NOT_LET_IN = 4401;

export class Socket {
  /**
   * @param {string} url
   * @param {Listener} listener
   */
  constructor(url, listener) {
    this.url = url;
    this.listener = listener;
    /** Round trip in milliseconds; null while unknown. @type {number | null} */
    this.tripMs = null;
    /** What has come since the page was opened. */
    this.messages = 0;
    this.bytes = 0;
    /** How far this device's clock is before URC's, in milliseconds; null while unknown. @type {number | null} */
    this.skewMs = null;
    /** Connections lost and attempts failed since the last good one. */
    this.failures = 0;
    /** Why the server closed, in its words. */
    this.reason = "";
    this.isUp = false;
    /** Whether the server wants its printed address to be opened first. */
    this.isShutOut = false;
    /** @type {WebSocket | null} */
    this.line = null;
    this.waitMs = FIRST_WAIT_MS;
    this.isWanted = false;
    /** When the ping that waits for its answer was sent; 0 when none waits. */
    this.pingedMs = 0;
    /** Ticks since then. */
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

  /** Try now instead of when the back-off says: the network or the page is back. */
  hurry() {
    if (this.isWanted && !this.line) this.connect();
  }

  /**
   * @param {object} message
   * @returns {boolean} whether it was handed to the browser
   */
  send(message) {
    // The browser may know that it is closing before anybody is told by an event.
    if (!this.isUp || !this.line || this.line.readyState !== WebSocket.OPEN) return false;
    this.line.send(JSON.stringify(message));
    return true;
  }

  /** Bytes that were handed to the browser and have not left it. */
  get unsent() {
    return this.line?.bufferedAmount ?? 0;
  }

  connect() {
    clearTimeout(this.retry);
    const line = new WebSocket(this.url);
    this.line = line;
    line.binaryType = "arraybuffer";
    this.pingedMs = performance.now(); // an opening that hangs is given up like a missing pong
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
      this.listener.message(message); // the first ping waits for `tick`: a page that starts is slow
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
    if (this.silent >= SILENT_TICKS) this.lose("no answer");
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
    this.reason = reason;
    this.isUp = false;
    this.failures += 1;
    this.listener.state(false);
    if (!this.isWanted) return;
    // Jitter, so that many pages do not come back in the same instant.
    this.retry = window.setTimeout(() => this.connect(), this.waitMs * (0.8 + 0.4 * Math.random()));
    this.waitMs = Math.min(this.waitMs * 2, LONGEST_WAIT_MS);
  }
}
