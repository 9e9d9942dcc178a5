// @ts-check
/** Stored state of widgets for the lifetime of the tab: one value for each slot of a page. */

const MOST_CHARACTERS = 20_000;

/**
 * @param {string} slot
 * @returns {{read: () => unknown, write: (value: unknown) => void}}
 */
export function memoryOf(slot) {
  const key = `urc-memory ${location.pathname} ${slot}`;
  /** Fallback without storage. @type {unknown} */
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
        // Without storage, the value lasts until the page closes.
      }
    },
  };
}
