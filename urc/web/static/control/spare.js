// @ts-check
/**
 * A second line to the server while this page drives over a link that loses packets.
 *
 * What a connection has lost holds up all that comes after it. Two connections hardly lose at the
 * same time, so what is said about held controls goes over both, and the first of each two counts.
 */

const AGAIN_MS = 1000;

export class Spare {
  /**
   * @param {string} url "": there is none
   * @param {(message: any) => void} take has what the server says there
   */
  constructor(url, take) {
    this.url = url;
    this.take = take;
    /** What names this page's seat; "" while no line is wanted. */
    this.key = "";
    /** @type {WebSocket | null} */
    this.line = null;
    /** @type {number | undefined} */
    this.retry = undefined;
  }

  /** Whether what is said goes out at once. */
  get isFree() {
    return this.line?.readyState === WebSocket.OPEN && this.line.bufferedAmount === 0;
  }

  /** @param {string} key of the seat, or "" when no line is wanted */
  want(key) {
    if (key === this.key || !this.url) return;
    this.close();
    this.key = key;
    if (key) this.open();
  }

  open() {
    const line = new WebSocket(this.url);
    this.line = line;
    line.addEventListener("open", () => {
      if (line === this.line) line.send(JSON.stringify({ t: "spare", key: this.key }));
      else line.close(); // not wanted any more meanwhile
    });
    line.addEventListener("message", (event) => {
      if (line === this.line && typeof event.data === "string") this.take(JSON.parse(event.data));
    });
    line.addEventListener("close", () => {
      if (line !== this.line) return;
      this.line = null;
      this.retry = window.setTimeout(() => this.open(), AGAIN_MS);
    });
  }

  close() {
    const line = this.line;
    this.line = null;
    this.key = "";
    clearTimeout(this.retry);
    if (line?.readyState === WebSocket.OPEN) line.close();
  }

  /**
   * @param {object} message
   * @returns {boolean} whether it was handed to the browser, with nothing before it
   */
  send(message) {
    if (!this.isFree) return false;
    this.line?.send(JSON.stringify(message));
    return true;
  }
}
