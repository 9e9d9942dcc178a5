// @ts-check
/**
 * Signals of which each reading counts: which ones are new, how many were lost, and who hears them.
 *
 * The server numbers the readings of such signals. After a cut it tells the newest one again, and by
 * its number that is known; a number that is left out was lost on the way. Knows no page.
 */

export class Each {
  constructor() {
    this.session = "";
    /** Signal → number of its newest reading. @type {Map<string, number>} */
    this.known = new Map();
    /** @type {Map<string, Set<(missed: number) => void>>} */
    this.listeners = new Map();
  }

  /**
   * The server says in which session of the robot it counts; in another one numbers begin again.
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
   * @param {Record<number, number> | undefined} numbers of the next one, by index; counted up
   * @param {number} index
   * @param {string} name
   * @returns {number} how many were lost before it; -1 when it is known already
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
   * Call a listener for each new reading of a signal, as soon as the page has it.
   *
   * @param {string} name
   * @param {(missed: number) => void} listener is told how many were lost before it
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
