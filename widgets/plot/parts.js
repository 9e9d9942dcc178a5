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
 * Create one entry of the legend: a button that shows or hides the line of a signal.
 *
 * @param {string} name
 * @param {string} hint
 * @param {boolean} isShown
 */
export function legendItem(name, hint, isShown) {
  const item = document.createElement("li");
  const button = document.createElement("button");
  button.type = "button";
  button.className = "plot-entry";
  button.setAttribute("aria-pressed", String(isShown));
  button.title = hint;
  for (const [part, text] of Object.entries({ swatch: "", name, value: "—" })) {
    const made = document.createElement("span");
    made.className = `plot-${part}`;
    made.textContent = text;
    button.append(part === "value" ? roomFor(made) : made);
  }
  item.append(button);
  return { item, button };
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
 */
export function writeValue(el, text) {
  write(el, text);
  const room = el.parentElement;
  if (!room || text.length <= (rooms.get(room) ?? CHARACTERS)) return;
  rooms.set(room, text.length);
  style(room, "--plot-characters", String(text.length));
}
