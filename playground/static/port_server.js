// @ts-check
/**
 * The dashboard's server in this page: it replaces `core/server.js` of the dashboard. The server is a
 * worker; a message port carries what a WebSocket would.
 *
 * @typedef {object} Host the page around the frame
 * @property {(url: string, port: MessagePort) => void} connect
 * @property {(method: string, url: string, body: string) => Promise<{status: number, text: string}>} ask
 * @property {(query: string) => Promise<string>} page
 */

/** @returns {Host} */
function host() {
  const found = /** @type {any} */ (window.parent).urcPlayground;
  if (!found) throw new Error("this page needs the playground around it");
  return found;
}

/** The part of a WebSocket that the dashboard uses, over a message port. */
class PortSocket extends EventTarget {
  /** @param {string} url */
  constructor(url) {
    super();
    this.binaryType = "arraybuffer";
    /** A port takes everything at once. */
    this.bufferedAmount = 0;
    /** @type {number} */
    this.readyState = WebSocket.OPEN;
    const { port1, port2 } = new MessageChannel();
    this.port = port1;
    port1.addEventListener("message", ({ data }) => this.take(data));
    port1.start();
    host().connect(url, port2);
    queueMicrotask(() => this.dispatchEvent(new Event("open")));
  }

  /** @param {string} data */
  send(data) {
    if (this.readyState === WebSocket.OPEN) this.port.postMessage(data);
  }

  close() {
    if (this.readyState !== WebSocket.OPEN) return;
    this.port.postMessage(null);
    this.ended(1000, "");
  }

  /** @param {string | ArrayBuffer | {code: number, reason: string}} data */
  take(data) {
    if (typeof data === "string" || data instanceof ArrayBuffer) {
      this.dispatchEvent(new MessageEvent("message", { data }));
    } else {
      this.ended(data.code, data.reason);
    }
  }

  /**
   * @param {number} code
   * @param {string} reason
   */
  ended(code, reason) {
    if (this.readyState === WebSocket.CLOSED) return;
    this.readyState = WebSocket.CLOSED;
    this.dispatchEvent(new CloseEvent("close", { code, reason }));
    this.port.close();
  }
}

/** @param {string} url */
export function openSocket(url) {
  return new PortSocket(url);
}

/** Return null: images come over the page's only socket. @returns {Worker | null} */
export function pictureWorker() {
  return null;
}

/**
 * @param {string} path
 * @param {RequestInit} how
 */
export async function request(path, how) {
  const { status, text } = await host().ask(how.method ?? "GET", path, typeof how.body === "string" ? how.body : "");
  return new Response(text, { status, headers: { "content-type": "application/json" } });
}

/**
 * @param {URL} address
 * @returns {Promise<{status: number, page: Document | null}>}
 */
export async function fetchPage(address) {
  const html = await host().page(address.search.slice(1));
  return { status: 200, page: new DOMParser().parseFromString(html, "text/html") };
}
