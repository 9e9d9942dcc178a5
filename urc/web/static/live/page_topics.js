// @ts-check
/**
 * Page data other than signals, for followers: immediately and after every change, always in an
 * animation frame. Topics without followers cost no time.
 *
 * @typedef {import("../core/types.js").Line} Line
 * @typedef {import("../core/types.js").LogLine} LogLine
 * @typedef {import("../core/types.js").Topics} Topics
 * @typedef {import("./store.js").Store} Store
 *
 * @typedef {{[T in keyof Topics]: () => {look: string, value: Topics[T]}}} Sources Each function
 *   returns the current value, and a text that changes with it.
 */

export class PageTopics {
  /**
   * @param {Sources} sources
   * @param {() => void} wake requests an animation frame
   */
  constructor(sources, wake) {
    this.sources = sources;
    this.wake = wake;
    /** @type {Set<{what: keyof Topics, seen: string | null, tell: (news: any) => void}>} */
    this.followers = new Set();
  }

  /**
   * @param {keyof Topics} what
   * @param {(news: any) => void} tell
   * @param {AbortSignal} signal
   */
  listen(what, tell, signal) {
    if (!Object.hasOwn(this.sources, what)) {
      const known = Object.keys(this.sources).join(", ");
      throw new Error(`there is no ${what} to follow, only ${known}`);
    }
    const follower = { what, seen: null, tell };
    this.followers.add(follower);
    signal.addEventListener("abort", () => this.followers.delete(follower));
    this.wake();
  }

  frame() {
    /** @type {Map<keyof Topics, {look: string, value: unknown}>} */
    const known = new Map();
    for (const follower of [...this.followers]) {
      const news = known.get(follower.what) ?? this.sources[follower.what]();
      known.set(follower.what, news);
      if (follower.seen === news.look) continue;
      follower.seen = news.look;
      follower.tell(news.value);
    }
  }
}

const LINES_KEPT = 500;

/** The newest lines of the log. */
export class Log {
  constructor() {
    /** @type {LogLine[]} */
    this.lines = [];
    this.missing = 0;
    this.session = "";
    this.next = 0;
  }

  /**
   * Add lines; known lines, which the server repeats after a reconnect, are skipped.
   *
   * @param {readonly Line[]} lines
   * @param {number} first number of the first line in its session, from 0
   * @param {string} session
   */
  add(lines, first, session) {
    if (session !== this.session) {
      this.session = session;
      this.next = first;
    }
    this.missing += Math.max(0, first - this.next);
    const fresh = lines.slice(Math.max(0, this.next - first));
    let number = Math.max(first, this.next);
    for (const { age, level, source, text } of fresh) {
      this.lines.push({ number, time: Date.now() - age, level, source, text });
      number += 1;
    }
    this.next = Math.max(this.next, first + lines.length);
    if (this.lines.length > LINES_KEPT) this.lines.splice(0, this.lines.length - LINES_KEPT);
  }

  news() {
    return {
      look: `${this.session} ${this.next} ${this.missing} ${this.lines.length}`,
      value: { lines: this.lines, missing: this.missing },
    };
  }
}

/**
 * Return the number of signals with a limit, and of those with a known value. Signals without a
 * known value may exceed their limits.
 *
 * @param {Store} store
 * @param {number} nowMs
 */
export function watched(store, nowMs) {
  const limited = [...store.signals.values()].filter(({ has_alarms }) => has_alarms);
  const known = limited.filter(({ name }) => store.state(name, nowMs) === "live");
  const value = { limited: limited.length, known: known.length };
  return { look: JSON.stringify(value), value };
}

/** Reports changes of the page's colours, by the user's choice or by the system. */
export class Themes {
  /** @param {() => void} wake */
  constructor(wake) {
    const changed = () => {
      this.count += 1;
      wake();
    };
    this.count = 0;
    const root = document.documentElement;
    new MutationObserver(changed).observe(root, { attributeFilter: ["data-theme"] });
    // Over a picture, widgets are dark: a swapped view or another width changes their colours.
    new MutationObserver(changed).observe(root, { subtree: true, attributeFilter: ["data-place", "data-picture"] });
    for (const query of ["(prefers-color-scheme: dark)", "(forced-colors: active)", "(width >= 37.5rem)"]) {
      matchMedia(query).addEventListener("change", changed);
    }
  }

  news() {
    const name = document.documentElement.dataset["theme"] ?? "";
    return { look: String(this.count), value: { name } };
  }
}
