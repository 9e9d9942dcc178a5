// @ts-check
/**
 * The receiving side of the page's socket for images, outside the page's thread. A script without imports, because
 * it runs in a worker. `urc/web/feed/picture_line.py` explains the socket.
 *
 * A worker confirms data at once, also while the page is busy, so the server measures the line and not the page.
 * The page posts {url, key}, and null to close the socket. The worker posts each message as {data, timeMs}, with its
 * time of arrival in milliseconds since 1970.
 */

const LAST = 1;
const CONFIRM = 2;
const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 5000;
/** Maximum size of a message, in bytes. */
const MOST_BYTES = 2 ** 25;

/** Joins the parts of messages. */
class Parts {
  constructor() {
    /** Bytes received, with the flags. */
    this.received = 0;
    /** @type {Uint8Array[]} */
    this.waiting = [];
    this.bytes = 0;
  }

  /**
   * @param {ArrayBuffer} data
   * @returns {{message: ArrayBuffer | null, confirmed: string}} the message that `data` completes, and the answer
   *   to the server, "" for none
   */
  take(data) {
    const flags = new Uint8Array(data, 0, Math.min(1, data.byteLength))[0] ?? 0;
    this.received += data.byteLength;
    this.waiting.push(new Uint8Array(data, Math.min(1, data.byteLength)));
    this.bytes += data.byteLength;
    const isWhole = (flags & LAST) !== 0 || this.bytes > MOST_BYTES;
    const message = isWhole ? this.join() : null;
    return { message, confirmed: flags & CONFIRM ? String(this.received) : "" };
  }

  join() {
    const size = this.waiting.reduce((sum, part) => sum + part.byteLength, 0);
    const message = new Uint8Array(size);
    let place = 0;
    for (const part of this.waiting) {
      message.set(part, place);
      place += part.byteLength;
    }
    this.waiting = [];
    this.bytes = 0;
    return message.buffer;
  }
}

/** @type {WebSocket | null} */
let line = null;
/** @type {{url: string, key: string} | null} */
let wanted = null;
let waitMs = FIRST_WAIT_MS;
/** @type {number | undefined} */
let retry;

function connect() {
  if (!wanted) return;
  const { url, key } = wanted;
  const made = new WebSocket(url);
  const parts = new Parts();
  line = made;
  made.binaryType = "arraybuffer";
  made.addEventListener("open", () => made.send(JSON.stringify({ t: "pictures", key })));
  made.addEventListener("message", ({ data }) => {
    if (made !== line || !(data instanceof ArrayBuffer)) return;
    waitMs = FIRST_WAIT_MS;
    const timeMs = performance.timeOrigin + performance.now();
    const { message, confirmed } = parts.take(data);
    if (confirmed) made.send(confirmed);
    if (message) /** @type {any} */ (globalThis).postMessage({ data: message, timeMs }, [message]);
  });
  made.addEventListener("close", () => {
    if (made !== line) return;
    line = null;
    retry = setTimeout(connect, waitMs);
    waitMs = Math.min(LONGEST_WAIT_MS, 2 * waitMs);
  });
}

addEventListener("message", ({ data }) => {
  wanted = data;
  const last = line;
  line = null;
  clearTimeout(retry);
  waitMs = FIRST_WAIT_MS;
  last?.close();
  connect();
});
