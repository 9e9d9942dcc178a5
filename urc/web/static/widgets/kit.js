// @ts-check
/**
 * What widgets need again and again: `import { part, write } from "urc/kit"`.
 *
 * Nothing here reads the layout, and what writes does so on change only, so all of it may be called
 * in `update`. Knows no widget, no socket, no store.
 *
 * @typedef {import("../core/types.js").Alarm} Alarm
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").Signal} Signal
 */

import { fixed, rough } from "../core/figures.js";
import { Sheet } from "./sheet.js";
import { mark } from "../core/words.js";

export { digitsIn, figure } from "../core/figures.js";
export { inTurn, wordOf } from "../core/texts.js";
export { mark, t } from "../core/words.js";

/** "None": what is not known is never shown as 0. */
export const DASH = "—";

const SVG = "http://www.w3.org/2000/svg";

/** A browser that asks where to save a file reads it only after the answer. */
const KEPT_MS = 10_000;

/** How a limit that was passed is written: a shape and a word, since colour is never alone. */
export const ALARMS = Object.freeze({
  "": "",
  lolo: mark("▲ Very low"),
  low: mark("◆ Low"),
  high: mark("◆ High"),
  hihi: mark("▲ Very high"),
});

/**
 * Return the element of the template that a widget cannot do without.
 *
 * @param {ParentNode} root
 * @param {string} selector
 * @returns {HTMLElement}
 */
export function part(root, selector) {
  const found = root.querySelector(selector);
  if (!(found instanceof HTMLElement)) throw new Error(`the template has no ${selector}`);
  return found;
}

/**
 * The same for a drawing.
 *
 * @param {ParentNode} root
 * @param {string} selector
 * @returns {SVGElement}
 */
export function drawing(root, selector) {
  const found = root.querySelector(selector);
  if (!(found instanceof SVGElement)) throw new Error(`the template has no ${selector}`);
  return found;
}

/**
 * Return the time of day for people, the same on logs and plots: 24 hours, in this device's zone.
 *
 * @param {Date} time
 */
export function clock(time) {
  return time.toLocaleTimeString([], { hour12: false });
}

/**
 * Write a text, on change only.
 *
 * @param {Element} el
 * @param {string} text
 */
export function write(el, text) {
  const only = el.childNodes.length === 1 ? el.firstChild : null;
  if (text && only instanceof Text) {
    // The node stays: another one would have the browser match the page's selectors anew.
    if (only.data !== text) only.data = text;
  } else if (el.textContent !== text) {
    el.textContent = text;
  }
}

/**
 * Write an attribute, on change only; null takes it away.
 *
 * @param {Element} el
 * @param {string} name
 * @param {string | null} value
 */
export function attribute(el, name, value) {
  if (value === null) {
    if (el.hasAttribute(name)) el.removeAttribute(name);
  } else if (el.getAttribute(name) !== value) {
    el.setAttribute(name, value);
  }
}

/** What was written: reading it back from the element costs more. @type {WeakMap<Element, Map<string, string>>} */
const styles = new WeakMap();

/**
 * Write a property of the element's style, on change only. Whoever uses it for a property writes
 * that one by nothing else.
 *
 * @param {Element} el
 * @param {string} name as "--value-share" or "transform"
 * @param {string} value
 */
export function style(el, name, value) {
  const known = styles.get(el);
  if (known?.get(name) === value) return;
  if (!(el instanceof HTMLElement || el instanceof SVGElement)) return;
  if (known) known.set(name, value);
  else styles.set(el, new Map([[name, value]]));
  el.style.setProperty(name, value);
}

/** For how long a text has to be shorter before it is written larger. */
const LARGER_AFTER_MS = 2000;
/** For how many characters each place has room, and until when more than it needs. @type {WeakMap<Element, {room: number, untilMs: number}>} */
const rooms = new WeakMap();

/**
 * Tell the style sheet, by a property, for how many characters a text has to have room. In steps of
 * two, larger at once and smaller only after a while, so that digits which change change no size.
 *
 * @param {Element} el
 * @param {string} name as "--value-characters"
 * @param {number} characters
 * @param {boolean} [isExact] in no steps: the text fills all the room that it has
 */
export function fit(el, name, characters, isExact = false) {
  const needed = isExact ? characters : clamp(2 * Math.ceil(characters / 2), 4, 40);
  const known = rooms.get(el);
  const nowMs = performance.now();
  if (known && needed === known.room) known.untilMs = nowMs + LARGER_AFTER_MS;
  if (known && needed <= known.room && nowMs < known.untilMs) return;
  rooms.set(el, { room: needed, untilMs: nowMs + LARGER_AFTER_MS });
  style(el, name, String(needed));
}

/** What has to be told when a while has passed. @type {Map<Element, Readonly<Record<string, string | null>>>} */
const untold = new Map();
/** When each element told last. @type {WeakMap<Element, number>} */
const toldMs = new WeakMap();
const TELL_EVERY_MS = 500;

/**
 * Write attributes that only screen readers read, on change only: at once, and then at most twice a
 * second, the newest winning. Nobody hears more, and a meter that moves in each frame need not pay
 * for it.
 *
 * @param {Element} el
 * @param {Readonly<Record<string, string | null>>} attributes
 */
export function tell(el, attributes) {
  const waitMs = (toldMs.get(el) ?? -Infinity) + TELL_EVERY_MS - performance.now();
  if (waitMs > 0) {
    if (untold.size === 0) setTimeout(tellRest, waitMs);
    untold.set(el, attributes);
    return;
  }
  untold.delete(el);
  toldMs.set(el, performance.now());
  for (const [name, value] of Object.entries(attributes)) attribute(el, name, value);
}

function tellRest() {
  const rest = [...untold];
  untold.clear();
  for (const [el, attributes] of rest) tell(el, attributes);
}

/**
 * Make an element of a drawing.
 *
 * @template {keyof SVGElementTagNameMap} T
 * @param {T} name
 * @param {Record<string, string | number>} [attributes]
 * @returns {SVGElementTagNameMap[T]}
 */
export function svg(name, attributes = {}) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  return made;
}

/**
 * Make a button.
 *
 * @param {string} className
 * @param {string} text
 * @param {() => void} press
 * @param {{signal: AbortSignal, label?: string}} more `label` is its name where `text` is only a sign
 */
export function button(className, text, press, { signal, label = "" }) {
  const made = document.createElement("button");
  made.type = "button";
  made.className = className;
  made.textContent = text;
  if (label) made.setAttribute("aria-label", label);
  made.addEventListener("click", press, { signal });
  return made;
}

/**
 * @param {number} value
 * @param {number} least
 * @param {number} most
 */
export function clamp(value, least, most) {
  return Math.min(most, Math.max(least, value));
}

/**
 * Return a number for people; "—" for whatever is none.
 *
 * @param {unknown} value
 * @param {number} [digits] after the point; when left out, four that mean something, and all before it
 */
export function format(value, digits) {
  if (typeof value !== "number" || !Number.isFinite(value)) return DASH;
  return digits === undefined ? rough(value) : fixed(value, digits);
}

/**
 * Return the number that a reading holds; null when it holds none that can be drawn.
 *
 * @param {Reading | undefined} reading
 * @returns {number | null}
 */
export function number(reading) {
  const value = reading?.value;
  return typeof value === "number" && Number.isFinite(value) ? value : null;
}

/**
 * Return what the robot says for a word; the word itself where it has no other.
 *
 * @param {Pick<Signal, "states"> | undefined} signal
 * @param {unknown} word
 */
export function keyOf(signal, word) {
  const found = Object.entries(signal?.states ?? {}).find(([, text]) => text === String(word));
  return found ? found[0] : String(word);
}

/**
 * Return the numbers that a reading of an array holds, null for those that are not known; null when
 * there is no array.
 *
 * @param {Reading | undefined} reading
 * @returns {(number | null)[] | null}
 */
export function numbers(reading) {
  const value = reading?.value;
  if (!Array.isArray(value)) return null;
  return value.map((each) => (typeof each === "number" && Number.isFinite(each) ? each : null));
}

/**
 * Return the readings of an input that takes many signals, in the order in which they are bound.
 *
 * @param {Reading | undefined} readings
 * @returns {readonly Reading[]}
 */
export function many(readings) {
  return Array.isArray(readings) ? readings : [];
}

/**
 * Return what is to be said beside a value: that there is none, how old it is, which limit it passed.
 *
 * @param {Pick<Reading, "state" | "age" | "alarm">} reading
 * @param {(text: string, names?: Record<string, string | number>) => string} t the context's
 */
export function noteOf({ state, age, alarm }, t) {
  if (state === "none") return t("no value yet");
  if (state === "gone") return t("seen {age} ago", { age });
  const old = state === "stale" ? t("{age} old", { age }) : "";
  return [alarm ? t(ALARMS[alarm]) : "", old].filter(Boolean).join(" · ");
}

/**
 * Return how several readings are that are shown as one, for `noteOf`: the oldest of those that are
 * known, and the gravest alarm. Readings that are not there do not count beside others that are.
 *
 * @param {readonly (Reading | undefined)[]} readings
 * @returns {{state: Reading["state"], age: string, alarm: Alarm}}
 */
export function worst(readings) {
  const bound = readings.flatMap((reading) => (reading ? [reading] : []));
  const order = /** @type {const} */ (["stale", "live", "gone"]);
  const found = order.map((state) => bound.find((reading) => reading.state === state)).find(Boolean);
  const alarms = /** @type {const} */ (["hihi", "lolo", "high", "low"]);
  const alarm = alarms.find((name) => bound.some((reading) => reading.alarm === name)) ?? "";
  return { state: found?.state ?? "none", age: found?.age ?? "", alarm };
}

/** What `board` draws on. @type {WeakMap<HTMLCanvasElement, Sheet>} */
const sheets = new WeakMap();

/**
 * Return what draws on a canvas, sized to the box it has in the page and to the screen's pixels, and
 * wiped. Call it whenever all is drawn anew, and draw at once: it is shown when the code that runs
 * has ended.
 *
 * @param {HTMLCanvasElement} canvas
 * @param {{width: number, height: number}} size in CSS pixels
 * @returns {CanvasRenderingContext2D}
 */
export function board(canvas, { width, height }) {
  const sheet = sheets.get(canvas) ?? new Sheet(canvas);
  sheets.set(canvas, sheet);
  const density = Math.min(3, globalThis.devicePixelRatio || 1);
  sheet.resize(Math.max(1, Math.round(width * density)), Math.max(1, Math.round(height * density)));
  const { pen } = sheet;
  pen.setTransform(density, 0, 0, density, 0, 0);
  pen.clearRect(0, 0, width, height);
  sheet.showSoon();
  return pen;
}

/**
 * Return the colours of the theme by their tokens, for a canvas: `{ level: "rgb(…)" }` for
 * `--urc-level`. It reads styles: ask when mounting, and whenever `ctx.follow("theme", …)` calls.
 *
 * @template {string} T
 * @param {Element} el
 * @param {readonly T[]} names without `--urc-`
 * @returns {Record<T, string>}
 */
export function colours(el, names) {
  // Only a used colour is resolved: the token itself may say `light-dark(…)`, or a system colour.
  const probe = document.createElement("span");
  probe.hidden = true;
  el.append(probe);
  const look = getComputedStyle(probe);
  const pairs = names.map((name) => {
    probe.style.color = `var(--urc-${name})`;
    return [name, look.color];
  });
  probe.remove();
  return /** @type {Record<T, string>} */ (Object.fromEntries(pairs));
}

/** Whether a person has asked for less motion. */
export function isStill() {
  still ??= matchMedia("(prefers-reduced-motion: reduce)");
  return still.matches;
}

/** Asked for in each frame. @type {MediaQueryList | undefined} */
let still;

/**
 * Let the browser keep a text as a file on this device.
 *
 * @param {string} text
 * @param {string} name
 * @param {string} type its media type, as "text/csv"
 */
export function save(text, name, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), KEPT_MS);
}
