// @ts-check
/**
 * Small elements of the plot, and its use of browser functions.
 */
import { format, style, write } from "urc/kit";
import { digitsOf, ticks } from "urc/axis_ticks";

/** Milliseconds since 1970 at time 0 of the page's clock. */
export function epoch() {
  return Date.now() - performance.now();
}

/**
 * @param {string} name
 * @param {string} top
 * @param {string} [text]
 */
function placed(name, top, text = "") {
  const made = document.createElement("div");
  made.className = name;
  made.style.top = top;
  made.textContent = text;
  return made;
}

/**
 * Create the labels of a scale, with a line for each label and each limit.
 *
 * @param {readonly [number, number]} scale
 * @param {readonly [string, number][]} limits
 * @param {(value: number) => number} factor conversion of both to the displayed unit
 */
export function ruled(scale, limits, factor) {
  const [least, most] = [factor(scale[0]), factor(scale[1])];
  const top = (/** @type {number} */ value) => `${((100 * (most - value)) / (most - least)).toFixed(2)}%`;
  const values = ticks(least, most, 4);
  const digits = digitsOf(values);
  const figures = values.map((value) => placed("plot-figure", top(value), format(value, digits)));
  const lines = values.map((value) => placed("plot-line", top(value)));
  for (const [name, limit] of limits) {
    if (limit <= scale[0] || limit >= scale[1]) continue;
    const line = placed("plot-limit", top(factor(limit)));
    line.dataset["limit"] = name;
    lines.push(line);
  }
  return { figures, lines };
}

/**
 * Return the length of the first words that all names share, such as 6 for "Joint 1" and "Joint 2".
 *
 * @param {readonly string[]} names
 * @returns {number} in characters, with the last space; 0 for a single name
 */
export function sharedWords(names) {
  const [first = "", ...others] = names;
  let shared = others.length > 0 ? first.lastIndexOf(" ") + 1 : 0;
  while (shared > 0 && !others.every((name) => name.length > shared && name.startsWith(first.slice(0, shared)))) {
    shared = first.lastIndexOf(" ", shared - 2) + 1;
  }
  return shared;
}

/**
 * Create one entry of the legend: a button that shows or hides the line of a signal.
 *
 * @param {string} name
 * @param {number} shared number of its first characters that a small legend hides
 * @param {string} hint
 * @param {boolean} isShown
 */
export function legendItem(name, shared, hint, isShown) {
  const item = document.createElement("li");
  const button = document.createElement("button");
  button.type = "button";
  button.className = "plot-entry";
  button.setAttribute("aria-pressed", String(isShown));
  button.title = hint;
  const [swatch, title, value] = [span("swatch"), span("name"), span("value", "—")];
  title.append(span("shared", name.slice(0, shared)), name.slice(shared));
  title.dataset["textCut"] = ""; // a small plot shortens the name, never the value
  button.append(swatch, title, roomFor(value));
  item.append(button);
  return { item, button };
}

/**
 * @param {string} name
 * @param {string} [text]
 */
function span(name, text = "") {
  const made = document.createElement("span");
  made.className = `plot-${name}`;
  made.textContent = text;
  return made;
}

/** @param {HTMLElement} value */
function roomFor(value) {
  const room = document.createElement("span");
  room.className = "plot-room";
  room.append(value);
  return room;
}

/** First width of a value, in characters. */
const CHARACTERS = 6;
/** Larger widths, by element. @type {WeakMap<Element, number>} */
const rooms = new WeakMap();

/**
 * Write a value of the legend, and widen it if needed.
 *
 * @param {Element} el
 * @param {string} text
 * @returns {boolean} whether it became wider
 */
export function writeValue(el, text) {
  write(el, text);
  const room = el.parentElement;
  if (!room || text.length <= (rooms.get(room) ?? CHARACTERS)) return false;
  rooms.set(room, text.length);
  style(room, "--plot-characters", String(text.length));
  return true;
}
