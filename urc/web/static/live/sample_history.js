// @ts-check
/**
 * Signals for which every reading is sent: new readings, numbers of lost readings, and listeners.
 *
 * The server numbers the readings. After a reconnect, it repeats the newest reading, which the page
 * recognizes by its number. A gap in the numbers means loss. The module does not depend on a page.
 */

export class SampleHistory {
  constructor() {
    this.session = "";
    /** Number of each signal's newest reading. @type {Map<string, number>} */
    this.known = new Map();
    /** @type {Map<string, Set<(missed: number) => void>>} */
    this.listeners = new Map();
  }

  /**
   * Start a session of the robot; in a new session, the numbers start again.
   *
   * @param {string} session
   */
  begin(session) {
    if (session !== this.session) this.known.clear();
    this.session = session;
  }

  /**
   * Take the next reading of a signal in a frame.
   *
   * @param {Record<number, number> | undefined} numbers number of the next reading by index; incremented
   * @param {number} index
   * @param {string} name
   * @returns {number} number of lost readings before it; -1 for a known reading
   */
  take(numbers, index, name) {
    const number = numbers?.[index];
    if (!numbers || number === undefined) return 0;
    numbers[index] = number + 1;
    const known = this.known.get(name);
    if (known !== undefined && number <= known) return -1;
    this.known.set(name, number);
    return known === undefined ? 0 : number - known - 1;
  }

  /**
   * Call a listener for each new reading of a signal, as soon as it arrives.
   *
   * @param {string} name
   * @param {(missed: number) => void} listener receives the number of lost readings before the new
   *   one
   * @param {AbortSignal} signal
   */
  listen(name, listener, signal) {
    const others = this.listeners.get(name) ?? new Set();
    this.listeners.set(name, others.add(listener));
    signal.addEventListener("abort", () => {
      others.delete(listener);
      if (others.size === 0 && this.listeners.get(name) === others) this.listeners.delete(name);
    });
  }

  /**
   * @param {string} name
   * @param {number} missed
   */
  tell(name, missed) {
    if (this.listeners.size > 0) this.listeners.get(name)?.forEach((listener) => listener(missed));
  }
}
