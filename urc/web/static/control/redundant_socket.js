// @ts-check
/**
 * The redundant socket of a page in control over a lossy link.
 *
 * Packet loss delays all later data of a connection. Two connections rarely lose packets at the
 * same time, so messages about held controls are sent over both, and the first copy of each counts.
 */

import { openSocket } from "../core/server.js";

const AGAIN_MS = 1000;

export class RedundantSocket {
  /**
   * @param {string} url "" for no redundant socket
   * @param {(message: any) => void} take handles messages from the server
   */
  constructor(url, take) {
    this.url = url;
    this.take = take;
    /** Key of this page; "" while no socket is wanted. */
    this.key = "";
    /** @type {WebSocket | null} */
    this.line = null;
    /** @type {number | undefined} */
    this.retry = undefined;
  }

  /** Whether a message would be sent immediately. */
  get isFree() {
    return this.line?.readyState === WebSocket.OPEN && this.line.bufferedAmount === 0;
  }

  /** @param {string} key key of the page, or "" to close the socket */
  want(key) {
    if (key === this.key || !this.url) return;
    this.close();
    this.key = key;
    if (key) this.open();
  }

  open() {
    const line = openSocket(this.url);
    this.line = line;
    line.addEventListener("open", () => {
      if (line === this.line) line.send(JSON.stringify({ t: "spare", key: this.key }));
      else line.close(); // no longer wanted
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
   * @returns {boolean} whether the browser accepted it into an empty buffer
   */
  send(message) {
    if (!this.isFree) return false;
    this.line?.send(JSON.stringify(message));
    return true;
  }
}
