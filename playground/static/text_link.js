// @ts-check
/**
 * A text in the fragment of a URL: compressed, and never sent to a server.
 */

const KEY = "yaml=";
/** Longest text that a link may carry, in characters; a longer text is no link of this page. */
const MOST = 1_000_000;

/**
 * @param {string} text
 * @returns {Promise<string>} the fragment, with "#"
 */
export async function fragmentOf(text) {
  const packed = await through(new TextEncoder().encode(text), new CompressionStream("deflate-raw"));
  let binary = "";
  for (const byte of packed) binary += String.fromCharCode(byte);
  return `#${KEY}${btoa(binary).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "")}`;
}

/**
 * @param {string} fragment
 * @returns {Promise<string | null>} the text; null without a valid text
 */
export async function textOf(fragment) {
  const coded = fragment.replace(/^#/, "");
  if (!coded.startsWith(KEY) || coded.length > MOST) return null;
  try {
    const binary = atob(coded.slice(KEY.length).replaceAll("-", "+").replaceAll("_", "/"));
    const packed = Uint8Array.from(binary, (letter) => letter.charCodeAt(0));
    const text = await through(packed, new DecompressionStream("deflate-raw"), MOST);
    return new TextDecoder("utf-8", { fatal: true }).decode(text);
  } catch {
    return null;
  }
}

/**
 * @param {Uint8Array} data
 * @param {CompressionStream | DecompressionStream} filter
 * @param {number} most limit of the result in bytes
 */
async function through(data, filter, most = Infinity) {
  const stream = new Blob([/** @type {any} */ (data)]).stream().pipeThrough(/** @type {any} */ (filter));
  const reader = stream.getReader();
  /** @type {Uint8Array[]} */
  const parts = [];
  let size = 0;
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    size += value.length;
    if (size > most) throw new Error("too long");
    parts.push(value);
  }
  const whole = new Uint8Array(size);
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}
