// @ts-check
/** Full-text search in the lists of a page. */

/**
 * Return whether the text contains all typed words, at any position. Case and accents are ignored;
 * an empty search matches everything.
 *
 * @param {string} text
 * @param {string} typed
 */
export function fits(text, typed) {
  const all = plain(text);
  return plain(typed)
    .split(/\s+/)
    .every((word) => all.includes(word));
}

/** @param {string} text */
function plain(text) {
  return text
    .normalize("NFD")
    .replace(/\p{Mark}/gu, "")
    .toLowerCase();
}
