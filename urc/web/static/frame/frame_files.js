// @ts-check
/**
 * Files in the options of a third-party widget. A frame may not load a robot's files, so the page
 * passes them to the frame.
 */

const FILE = /^\/robots\/[^/]+\/files\//;
const MOST_FILES = 16;
const MOST_BYTES = 16 << 20;
const WITHIN_MS = 15_000;

/**
 * Whether a text is the URL of a robot's file, in its canonical form.
 *
 * @param {string} text
 */
function isFile(text) {
  return FILE.test(text) && new URL(text, "http://here").pathname === text;
}

/**
 * Return the files in the options by URL, without missing files.
 *
 * @param {Readonly<Record<string, unknown>>} options
 * @param {AbortSignal} signal
 * @returns {Promise<Record<string, Blob>>}
 */
export async function filesOf(options, signal) {
  const texts = Object.values(options).flat().filter((value) => typeof value === "string");
  const urls = [...new Set(texts.filter(isFile))].slice(0, MOST_FILES);
  /** @type {Record<string, Blob>} */
  const found = {};
  let bytes = 0;
  const limit = AbortSignal.any([signal, AbortSignal.timeout(WITHIN_MS)]);
  await Promise.all(
    urls.map(async (url) => {
      try {
        const answer = await fetch(url, { signal: limit });
        if (!answer.ok) throw new Error(`the server said ${answer.status}`);
        const file = await answer.blob();
        bytes += file.size;
        if (bytes > MOST_BYTES) throw new Error("its files are too large together");
        found[url] = file;
      } catch (error) {
        console.warn(`URC: ${url} cannot be given to a widget:`, error);
      }
    }),
  );
  return found;
}
