// @ts-check
/**
 * The messages between the page and a third-party widget in its frame. The module uses no DOM and
 * no socket.
 *
 * A frame runs third-party code. This module checks each of its messages before the message has any
 * effect. The page sends a frame only data of the frame's own bindings.
 *
 * @typedef {import("../widgets/output.js").Output} Output
 * @typedef {import("../core/types.js").Given} Given
 * @typedef {import("../core/types.js").Topics} Topics
 * @typedef {import("../core/types.js").Value} Value
 *
 * @typedef {{x: number, y: number, width: number, height: number}} Box Rectangle in CSS pixels of the frame.
 *
 * @typedef {object} Place Place of an element for holding.
 * @property {number} id
 * @property {Box} box
 * @property {Box[]} holes Parts that the overlay leaves uncovered, such as buttons.
 * @property {string} label
 * @property {string} said The element's value in words, for screen readers.
 * @property {boolean} isFocusable
 * @property {"none" | "free"} page Which of its keys work on the whole page.
 *
 * @typedef {(
 *   {t: "ready" | "mounted" | "in" | "out" | "more" | "stop" | "pads" | "onstop"}
 *   | {t: "failed", message: string}
 *   | {t: "alive", n: number}
 *   | {t: "slow", isSlow: boolean}
 *   | {t: "space", isTaken: boolean}
 *   | {t: "send", id: number, output: string, args: Record<string, Given>}
 *   | {t: "steer", output: string, verb: string}
 *   | {t: "drive", wish: import("../core/types.js").PendingValue}
 *   | {t: "follow", what: keyof Topics}
 *   | {t: "look", input: string, places: number[]}
 *   | {t: "memory", text: string}
 *   | {t: "hold", id: number, output: string, keys: string[], keysOn: number[], taps: string[], pad: "" | "left" | "right", stays: boolean}
 *   | {t: "gate", id: number, isHeld: boolean, timeoutMs: number, key: string, pad: "" | "left" | "right"}
 *   | {t: "places", places: Place[]}
 *   | {t: "values", id: number, n: number, values: Record<string, Value>}
 * )} Said A valid message from a frame.
 */

/** Number of messages per second above which a frame counts as a flood. */
export const MOST_MESSAGES = 1000;
/** Maximum number of commands per second. */
export const MOST_COMMANDS = 20;
const MOST_TEXT = 20_000;
const MOST_NAMES = 64;
const MOST_ITEMS = 10_000;
const MOST_GRIPS = 16;
const MOST_HOLES = 16;
/** Maximum number of additional elements that accept a held control's keys. */
const MOST_MORE = 4;
/** Keys that no widget may use, because they leave the widget or stop the robot. */
const NEVER_KEYS = new Set(["Escape", "Space", "Tab"]);
const VERBS = new Set(["pause", "step", "resume", "abort"]);
/** Permitted requests of third-party widgets; they do not include force, handover and reset. */
const WISHES = new Set(["take", "ask", "leave"]);
const TOPICS = new Set(["links", "lease", "alarms", "latency", "sequences", "theme"]);
const PLAIN = new Set(["ready", "mounted", "in", "out", "more", "stop", "pads", "onstop"]);

/** A limit on events per second. */
export class Rate {
  /** @param {number} most */
  constructor(most) {
    this.most = most;
    this.count = 0;
    this.sinceMs = -Infinity;
  }

  /**
   * Count one event; return false above the limit.
   *
   * @param {number} nowMs
   */
  take(nowMs) {
    if (nowMs - this.sinceMs >= 1000) {
      this.sinceMs = nowMs;
      this.count = 0;
    }
    this.count += 1;
    return this.count <= this.most;
  }
}

/** @param {unknown} value @returns {value is Record<string, unknown>} */
function isRecord(value) {
  return typeof value === "object" && value !== null && !Array.isArray(value);
}

/** @param {unknown} value @returns {value is number} */
function isNumber(value) {
  return typeof value === "number" && Number.isFinite(value);
}

/** @param {unknown} value @returns {value is Value} */
function isValue(value) {
  if (typeof value === "string") return value.length <= MOST_TEXT;
  return value === null || typeof value === "boolean" || isNumber(value);
}

/** @param {unknown} value @returns {value is Given} */
function isGiven(value) {
  if (Array.isArray(value)) return value.length <= MOST_ITEMS && value.every(isValue);
  return isValue(value);
}

/** @param {unknown} value */
const textOf = (value, most = 200) => (typeof value === "string" ? value.slice(0, most) : "");
/** @param {unknown} value @param {number} least @param {number} most */
const within = (value, least, most) => Math.min(most, Math.max(least, isNumber(value) ? value : 0));
/** @param {unknown} value @returns {"" | "left" | "right"} */
const sideOf = (value) => (value === "left" || value === "right" ? value : "");

/**
 * @template T
 * @param {unknown} args
 * @param {(value: unknown) => value is T} is
 * @returns {Record<string, T> | null}
 */
function named(args, is) {
  if (!isRecord(args)) return null;
  const pairs = Object.entries(args);
  if (pairs.length > MOST_NAMES) return null;
  /** @type {Record<string, T>} */
  const found = Object.create(null);
  for (const [name, value] of pairs) {
    if (!is(value)) return null;
    found[name] = value;
  }
  return found;
}

/** @param {unknown} keys */
function keysOf(keys) {
  const texts = Array.isArray(keys) ? keys.filter((key) => typeof key === "string") : [];
  return texts.filter((key) => key.length <= 40 && !NEVER_KEYS.has(key)).slice(0, MOST_NAMES);
}

/** @param {unknown} box @returns {Box} */
function boxOf(box) {
  const { x, y, width, height } = isRecord(box) ? box : {};
  const [left, top] = [within(x, 0, 1e5), within(y, 0, 1e5)];
  return { x: left, y: top, width: within(width, 0, 1e5), height: within(height, 0, 1e5) };
}

/** @param {unknown} list @param {number} most @returns {unknown[]} */
const listOf = (list, most) => (Array.isArray(list) ? list.slice(0, most) : []);

/** @param {unknown} place @returns {Place} */
function placeOf(place) {
  const { id, box, holes, label, said, isFocusable, page } = isRecord(place) ? place : {};
  return {
    id: within(id, -1, 1e6),
    box: boxOf(box),
    holes: listOf(holes, MOST_HOLES).map(boxOf),
    label: textOf(label),
    said: textOf(said),
    isFocusable: isFocusable === true,
    page: page === "free" || page === "all" ? "free" : "none",
  };
}

/**
 * Return a frame's message with its valid parts; null for an invalid message.
 *
 * @param {unknown} message
 * @param {Readonly<Record<string, Output>>} outputs bound outputs of its cell
 * @returns {Said | null}
 */
export function heard(message, outputs) {
  if (!isRecord(message) || typeof message["t"] !== "string") return null;
  const { t, id, n } = message;
  if (PLAIN.has(t)) return /** @type {Said} */ ({ t });
  const isBound = typeof message["output"] === "string" && Object.hasOwn(outputs, message["output"]);
  const output = isBound ? String(message["output"]) : "";
  const isId = Number.isSafeInteger(id);
  switch (t) {
    case "failed":
      return { t, message: textOf(message["message"], 1000) };
    case "alive":
      return isNumber(n) ? { t, n } : null;
    case "slow":
      return { t, isSlow: message["isSlow"] === true };
    case "space":
      return { t, isTaken: message["isTaken"] === true };
    case "send": {
      const args = named(message["args"], isGiven);
      return args && isId && isBound ? { t, id: Number(id), output, args } : null;
    }
    case "steer": {
      const verb = textOf(message["verb"]);
      return isBound && VERBS.has(verb) ? { t, output, verb } : null;
    }
    case "drive": {
      const wish = textOf(message["wish"]);
      return WISHES.has(wish) ? { t, wish: /** @type {import("../core/types.js").PendingValue} */ (wish) } : null;
    }
    case "follow": {
      const what = textOf(message["what"]);
      return TOPICS.has(what) ? { t, what: /** @type {keyof Topics} */ (what) } : null;
    }
    case "look": {
      const places = listOf(message["places"], MOST_MORE).map((each) => within(each, 0, 1e6));
      return { t, input: textOf(message["input"]), places };
    }
    case "memory": {
      const { text } = message;
      return typeof text === "string" && text.length <= MOST_TEXT ? { t, text } : null;
    }
    default:
      return gripped(message, isBound ? outputs[output] : undefined);
  }
}

/**
 * Return a message about held controls with its valid parts; null for an invalid message.
 *
 * @param {Record<string, unknown>} message
 * @param {Output | undefined} bound
 * @returns {Said | null}
 */
function gripped(message, bound) {
  const { t } = message;
  const id = Number.isSafeInteger(message["id"]) ? within(message["id"], 0, 1e6) : -1;
  const pad = sideOf(message["pad"]);
  if (t === "places") {
    return { t, places: listOf(message["places"], MOST_GRIPS).map(placeOf) };
  }
  if (id < 0) return null;
  if (t === "hold" && bound?.isHeld) {
    const keys = keysOf(message["keys"]);
    const stays = message["stays"] === true;
    const keysOn = listOf(message["keysOn"], MOST_MORE).map((each) => within(each, 0, 1e6));
    return { t, id, output: textOf(message["output"]), keys, keysOn, taps: keysOf(message["taps"]), pad, stays };
  }
  if (t === "gate") {
    const [key = ""] = keysOf([message["key"]]);
    const timeoutMs = within(message["timeoutMs"], 1000, 600_000);
    return { t, id, isHeld: message["isHeld"] !== false, timeoutMs, key, pad };
  }
  if (t === "values" && isNumber(message["n"])) {
    const values = named(message["values"], isValue);
    return values && { t, id, n: message["n"], values };
  }
  return null;
}

/**
 * Return the part of a topic that a frame may receive, limited to its bindings and without
 * addresses.
 *
 * @param {keyof Topics} what
 * @param {any} news
 * @param {{signals: ReadonlySet<string>, commands: ReadonlySet<string>}} bound
 * @returns {unknown}
 */
export function tellable(what, news, { signals, commands }) {
  switch (what) {
    case "links": {
      /** @type {Topics["links"]} */
      const { isUp, links, isRefused = false, isReplay = false } = news;
      return { isUp, isRefused, isReplay, links: links.map((link) => ({ ...link, address: "", detail: "" })) };
    }
    case "alarms":
      return /** @type {Topics["alarms"]} */ (news).filter(({ signal }) => signals.has(signal));
    case "sequences": {
      const pairs = Object.entries(/** @type {Topics["sequences"]} */ (news));
      return Object.fromEntries(pairs.filter(([command]) => commands.has(command)));
    }
    default:
      return news;
  }
}
