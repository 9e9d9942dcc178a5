// @ts-check
/**
 * The toolkit for widgets: `import { part, write } from "urc/kit"`.
 *
 * No function reads the layout, and functions write only changes, so all functions may be called in
 * `update`. The module uses no widget, no socket and no store.
 *
 * @typedef {import("../core/types.js").Alarm} Alarm
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").Signal} Signal
 */

import { SIGNS, usualPriority } from "../core/alarm_signs.js";
import { fixed, rough } from "../core/number_format.js";
import { Sheet } from "./offscreen_canvas.js";
import { mark } from "../core/words.js";

export { SIGNS } from "../core/alarm_signs.js";
export { digitsIn, figure } from "../core/number_format.js";
export { ageText, inTurn, wordOf } from "../core/formatting.js";
export { mark, t } from "../core/words.js";

/** Text of an unknown value, which is never shown as 0. */
export const DASH = "—";

const SVG = "http://www.w3.org/2000/svg";

/**
 * Lifetime of a saved file's URL. Browsers with a save dialog read the URL only after the dialog.
 */
const KEPT_MS = 10_000;

/** Words of each alarm, without a shape: see `alarmText`. */
export const ALARMS = Object.freeze({
  "": "",
  lolo: mark("Very low"),
  low: mark("Low"),
  high: mark("High"),
  hihi: mark("Very high"),
  minor: mark("Warning"),
  major: mark("Alarm"),
});

/**
 * Return a required element of the template.
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
 * Return a required element of a drawing.
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
 * Return the time of day as text for logs and plots, with 24 hours, in this device's time zone.
 *
 * @param {Date} time
 */
export function clock(time) {
  return time.toLocaleTimeString([], { hour12: false });
}

/**
 * Write a text if it has changed.
 *
 * @param {Element} el
 * @param {string} text
 */
export function write(el, text) {
  const only = el.childNodes.length === 1 ? el.firstChild : null;
  if (text && only instanceof Text) {
    // The text node stays, because a new node would make the browser match the page's selectors
    // again.
    if (only.data !== text) only.data = text;
  } else if (el.textContent !== text) {
    el.textContent = text;
  }
}

/**
 * Write an attribute if it has changed; null removes it.
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

/**
 * Written styles, because reading them from the element takes more time.
 *
 * @type {WeakMap<Element, Map<string, string>>}
 */
const styles = new WeakMap();

/**
 * Write a property of the element's style if it has changed. All writes of a property must use this
 * function.
 *
 * @param {Element} el
 * @param {string} name such as "--value-share" or "transform"
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

/** Time for which a text must be shorter before it is drawn larger. */
const LARGER_AFTER_MS = 2000;
/**
 * Room of each element in characters, and the time until which it may be too large.
 *
 * @type {WeakMap<Element, {room: number, untilMs: number}>}
 */
const rooms = new WeakMap();

/**
 * Write the room for a text, in characters, to a property of the style. The room grows immediately
 * in steps of two, and shrinks only after a while, so that changing digits do not change the font
 * size.
 *
 * @param {Element} el
 * @param {string} name such as "--value-characters"
 * @param {number} characters
 * @param {boolean} [isExact] without steps, so that the text fills its room
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

/** Attributes that wait for their next write. @type {Map<Element, Readonly<Record<string, string | null>>>} */
const untold = new Map();
/** Time of each element's last write. @type {WeakMap<Element, number>} */
const toldMs = new WeakMap();
const TELL_EVERY_MS = 500;

/**
 * Write changed attributes for screen readers immediately, and then at most twice a second, with
 * the newest values. Screen readers read no faster, and frequent writes would take time for meters
 * that move in each frame.
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
 * Make an element of an SVG drawing.
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
 * Make a button element.
 *
 * @param {string} className
 * @param {string} text
 * @param {() => void} press
 * @param {{signal: AbortSignal, label?: string}} more `label` is its name if `text` is only a symbol
 */
export function button(className, text, press, { signal, label = "" }) {
  const made = document.createElement("button");
  made.type = "button";
  made.className = className;
  made.textContent = text;
  if (label) {
    made.setAttribute("aria-label", label);
    made.title = label;
  }
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
 * Return a number as text; "—" for any other value.
 *
 * @param {unknown} value
 * @param {number} [digits] digits after the point; by default four significant ones, and the whole integer part
 */
export function format(value, digits) {
  if (typeof value !== "number" || !Number.isFinite(value)) return DASH;
  return digits === undefined ? rough(value) : fixed(value, digits);
}

/**
 * Return the number in a reading; null without a drawable number.
 *
 * @param {Reading | undefined} reading
 * @returns {number | null}
 */
export function number(reading) {
  const value = reading?.value;
  return typeof value === "number" && Number.isFinite(value) ? value : null;
}

/**
 * Return the robot's value for a word of a signal; by default, the word itself.
 *
 * @param {Pick<Signal, "states"> | undefined} signal
 * @param {unknown} word
 */
export function keyOf(signal, word) {
  const found = Object.entries(signal?.states ?? {}).find(([, text]) => text === String(word));
  return found ? found[0] : String(word);
}

/**
 * Return the numbers in a reading of an array, with null for unknown numbers; null without an
 * array.
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
 * Return the readings of a multiple input, in the order of the binding.
 *
 * @param {Reading | undefined} readings
 * @returns {readonly Reading[]}
 */
export function many(readings) {
  return Array.isArray(readings) ? readings : [];
}

/**
 * Return an alarm as text: the shape of its priority, and a word, because colour alone is not enough.
 *
 * @param {Pick<Reading, "alarm" | "priority">} reading
 * @param {(text: string, names?: Record<string, string | number>) => string} t `t` of the context
 */
export function alarmText({ alarm, priority }, t) {
  return alarm ? `${SIGNS[priority || usualPriority(alarm)]} ${t(ALARMS[alarm])}` : "";
}

/**
 * Return the note for a value: that it is missing, its age, or the exceeded limit.
 *
 * @param {Pick<Reading, "state" | "age" | "alarm" | "priority">} reading
 * @param {(text: string, names?: Record<string, string | number>) => string} t `t` of the context
 */
export function noteOf({ state, age, alarm, priority }, t) {
  if (state === "none") return t("no value yet");
  if (state === "gone") return t("seen {age} ago", { age });
  const old = state === "stale" ? t("{age} old", { age }) : "";
  return [alarmText({ alarm, priority }, t), old].filter(Boolean).join(" · ");
}

/**
 * Return the note for an image that the browser cannot decode.
 *
 * @param {Blob} blob
 * @param {(text: string, names?: Record<string, string | number>) => string} t `t` of the context
 */
export function faultOf({ type, size }, t) {
  const isKnown = type.startsWith("image/");
  const fault = isKnown
    ? t("this picture is damaged: {type}, {size} bytes", { type, size })
    : t("not a picture, or in an unknown format: {size} bytes", { size });
  return `▲ ${fault}`;
}

/**
 * Return the common state of several readings, for `noteOf`: the oldest known reading, and the
 * worst alarm. Missing readings are ignored if others are known.
 *
 * @param {readonly (Reading | undefined)[]} readings
 * @returns {Pick<Reading, "state" | "age" | "alarm" | "priority">}
 */
export function worst(readings) {
  const bound = readings.flatMap((reading) => (reading ? [reading] : []));
  const order = /** @type {const} */ (["stale", "live", "gone"]);
  const found = order.map((state) => bound.find((reading) => reading.state === state)).find(Boolean);
  const alarms = /** @type {const} */ (["hihi", "lolo", "high", "low"]);
  const bad = alarms.map((name) => bound.find((reading) => reading.alarm === name)).find(Boolean);
  return { state: found?.state ?? "none", age: found?.age ?? "", alarm: bad?.alarm ?? "", priority: bad?.priority ?? "" };
}

/** Offscreen canvases of `board`. @type {WeakMap<HTMLCanvasElement, Sheet>} */
const sheets = new WeakMap();

/**
 * Return a cleared drawing context for a canvas, with the size of its box in screen pixels. Call
 * the function for each redraw and draw immediately, because the result is shown at the end of the
 * running code.
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
 * `--urc-level`. The function reads styles, so call it when mounting, and for each call of
 * `ctx.follow("theme", …)`.
 *
 * @template {string} T
 * @param {Element} el
 * @param {readonly T[]} names without `--urc-`
 * @returns {Record<T, string>}
 */
export function colours(el, names) {
  // Browsers resolve only used colours, because a token may contain `light-dark(…)` or a system
  // colour.
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

/** Return whether the user prefers reduced motion. */
export function isStill() {
  still ??= matchMedia("(prefers-reduced-motion: reduce)");
  return still.matches;
}

/** Cached, because it is read in each frame. @type {MediaQueryList | undefined} */
let still;

/**
 * Save a text as a file on this device.
 *
 * @param {string} text
 * @param {string} name
 * @param {string} type media type, such as "text/csv"
 */
export function save(text, name, type) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), KEPT_MS);
}
