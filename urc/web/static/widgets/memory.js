// @ts-check
/** What a widget keeps for as long as the tab is open: one value for each slot of a page. */

const MOST_CHARACTERS = 20_000;

/**
 * @param {string} slot
 * @returns {{read: () => unknown, write: (value: unknown) => void}}
 */
export function memoryOf(slot) {
  const key = `urc-memory ${location.pathname} ${slot}`;
  /** Where the browser keeps nothing. @type {unknown} */
  let own = null;
  return {
    read() {
      try {
        const text = sessionStorage.getItem(key);
        return text === null ? own : JSON.parse(text);
      } catch {
        return own;
      }
    },
    write(value) {
      own = value;
      const text = JSON.stringify(value);
      if (text.length > MOST_CHARACTERS) throw new Error("a widget keeps too much");
      try {
        sessionStorage.setItem(key, text);
      } catch {
        // It is kept until the page is left, at least.
      }
    },
  };
}
