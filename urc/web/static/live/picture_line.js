// @ts-check
/**
 * The page's socket for images, which runs in a worker. Images on the main socket would delay values, replies and
 * the lease behind them.
 */
import { pictureWorker } from "../core/server.js";

/** Maximum age of a message on its way from the worker, in ms; a larger one is an error of the clocks. */
const LONGEST_MS = 5000;

export class PictureLine {
  /**
   * @param {string} url
   * @param {(data: ArrayBuffer, nowMs: number) => void} take handles a message, with its time of arrival
   * @param {() => Worker | null} [start]
   */
  constructor(url, take, start = pictureWorker) {
    this.url = url;
    this.take = take;
    this.start = start;
    /** Key of this page's present connection; "" without one. */
    this.key = "";
    /** @type {Worker | null} */
    this.worker = null;
    this.isAbsent = false;
    this.isWanted = false;
  }

  /** Set the key of the page; "" after the loss of its connection. @param {string} key */
  join(key) {
    if (key === this.key) return;
    this.key = key;
    if (this.isWanted) this.open();
  }

  /** Return whether images come over this line, and open it at their first use. */
  use() {
    if (!this.key || this.isAbsent) return false;
    if (!this.isWanted) {
      this.isWanted = true;
      this.open();
    }
    return !this.isAbsent;
  }

  open() {
    if (!this.worker && this.key) {
      this.worker = this.start();
      this.isAbsent = this.worker === null;
      this.worker?.addEventListener("message", ({ data }) => this.receive(data));
      this.worker?.addEventListener("error", () => this.giveUp());
    }
    this.worker?.postMessage(this.key ? { url: this.url, key: this.key } : null);
  }

  /** @param {{data: ArrayBuffer, timeMs: number}} message */
  receive({ data, timeMs }) {
    const nowMs = performance.now();
    const cameMs = timeMs - performance.timeOrigin;
    this.take(data, cameMs <= nowMs && cameMs > nowMs - LONGEST_MS ? cameMs : nowMs);
  }

  /** Leave the images on the main socket, because the worker does not run. */
  giveUp() {
    this.worker?.terminate();
    this.worker = null;
    this.isAbsent = true;
  }
}
