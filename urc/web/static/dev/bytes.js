// @ts-check
/**
 * Bytes in readable form. All elements consist of text nodes, because the text comes from robots.
 */

/** @type {Record<number, string>} */
const NAMED = { 9: "\\t", 10: "\\n", 13: "\\r", 27: "\\e", 0: "\\0" };
// Control characters, and marks that reorder text.
const HIDDEN = /[\u0000-\u001f\u007f-\u009f\u200e\u200f\u2028-\u202e\u2066-\u2069]/g;

/**
 * @param {string} base64
 * @returns {Uint8Array<ArrayBuffer>}
 */
export function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (char) => char.charCodeAt(0));
}

/** @param {Uint8Array} bytes */
export function hexOf(bytes) {
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join(" ");
}

/**
 * Return bytes as text, with escapes for invisible characters.
 *
 * @param {Uint8Array} bytes
 * @param {string} encoding Python's name of the encoding
 */
export function textOf(bytes, encoding) {
  return visible(decoder(encoding).decode(bytes));
}

/** @param {string} text */
export function visible(text) {
  return text.replace(HIDDEN, (char) => {
    const code = char.charCodeAt(0);
    if (NAMED[code]) return NAMED[code];
    return code < 256
      ? `\\x${code.toString(16).padStart(2, "0")}`
      : `\\u${code.toString(16).padStart(4, "0")}`;
  });
}

/** @param {number} count */
export function sizeText(count) {
  return `${String(count).replace(/\B(?=(\d{3})+$)/g, "\u202f")} byte${count === 1 ? "" : "s"}`;
}

/** @param {string} encoding */
function decoder(encoding) {
  try {
    return new TextDecoder(encoding.replaceAll("_", "-"));
  } catch {
    return new TextDecoder(); // the browser lacks this encoding
  }
}

/**
 * @param {string} name
 * @param {string} className
 * @param {string} [text]
 * @returns {HTMLElement}
 */
export function element(name, className, text) {
  const el = document.createElement(name);
  if (className) el.className = className;
  if (text !== undefined) el.textContent = text;
  return el;
}

/** @param {string[]} texts */
export function listElement(texts) {
  const list = element("ul", "");
  list.append(...texts.map((text) => element("li", "", visible(text))));
  return list;
}

/** @param {unknown} error */
export function wordsOf(error) {
  return visible(error instanceof Error ? error.message : String(error));
}
