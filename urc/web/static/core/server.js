// @ts-check
/**
 * The page's connections to its server. The playground replaces this module, because its server is
 * a worker of the page.
 */
import { scriptUrl } from "./trusted_scripts.js";

/** @param {string} url */
export function openSocket(url) {
  return new WebSocket(url);
}

/** Start the worker that receives images over a socket of its own. @returns {Worker | null} null without such a socket */
export function pictureWorker() {
  return new Worker(scriptUrl("pictures"));
}

/**
 * @param {string} path
 * @param {RequestInit} how
 */
export function request(path, how) {
  return fetch(path, how);
}

/**
 * Fetch a page as a document. Trusted types forbid parsing text. This function uses the browser's
 * own document parser, which runs no script of the page.
 *
 * @param {URL} address
 * @param {number} withinMs
 * @returns {Promise<{status: number, page: Document | null}>} rejected without a reply
 */
export function fetchPage(address, withinMs) {
  const asked = new XMLHttpRequest();
  asked.open("GET", address);
  asked.responseType = "document";
  asked.timeout = withinMs;
  return new Promise((resolve, reject) => {
    const fail = () => reject(new Error("no reply"));
    asked.addEventListener("error", fail);
    asked.addEventListener("timeout", fail);
    asked.addEventListener("load", () => resolve({ status: asked.status, page: asked.responseXML }));
    asked.send();
  });
}
