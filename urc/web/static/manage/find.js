// @ts-check
/** What people type to find one thing among many. */

/**
 * Return whether the text has each of the words, wherever they stand in it. Capitals and accents are no
 * difference; nothing typed fits everything.
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
