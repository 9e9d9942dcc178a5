// @ts-check
/**
 * The fixed drawings of the compass: the rose, and a tape of one and a half turns.
 */
import { svg } from "urc/kit";
import { bearing } from "./bearing.js";

const LETTERS = ["N", "E", "S", "W"];
/** Units of the tape per degree: 120 degrees are visible. */
export const PER_DEGREE = 200 / 120;

/** The needle that points straight up. */
const NEEDLE = /** @type {const} */ ([[0, -52], [24, 36], [0, 22], [-24, 36]]);

/**
 * Return the points of the needle for an SVG polygon.
 *
 * @param {number} degrees clockwise from straight up
 */
export function needle(degrees) {
  const radians = (degrees * Math.PI) / 180;
  const [sin, cos] = [Math.sin(radians), Math.cos(radians)];
  return NEEDLE.map(([x, y]) => `${(x * cos - y * sin).toFixed(2)},${(x * sin + y * cos).toFixed(2)}`).join(" ");
}

/**
 * @param {SVGElement} ticks
 * @param {SVGElement} letters
 * @returns {SVGTextElement[]} labels that stay upright while the rose turns
 */
export function drawRose(ticks, letters) {
  let path = "";
  for (let degrees = 0; degrees < 360; degrees += 5) {
    const inner = degrees % 90 === 0 ? 72 : degrees % 30 === 0 ? 76 : 80;
    path += `M${at(degrees, inner)}L${at(degrees, 84)}`;
  }
  ticks.setAttribute("d", path);
  const made = [];
  for (let degrees = 0; degrees < 360; degrees += 30) {
    const isMain = degrees % 90 === 0;
    const [x = "0", y = "0"] = at(degrees, 62).split(" ");
    const text = svg("text", { class: isMain ? "compass-letter" : "compass-number", x, y });
    text.textContent = isMain ? (LETTERS[degrees / 90] ?? "") : String(degrees / 10);
    text.style.transformOrigin = `${x}px ${y}px`;
    made.push(text);
  }
  letters.replaceChildren(...made);
  return made;
}

/**
 * @param {SVGElement} strip
 * @returns {{degrees: number, text: SVGTextElement}[]} labels of the tape
 */
export function drawStrip(strip) {
  let path = "";
  const labels = [];
  for (let degrees = -90; degrees <= 450; degrees += 5) {
    const x = (degrees * PER_DEGREE).toFixed(2);
    path += `M${x} ${degrees % 15 === 0 ? -14 : -9}V-4`;
    if (degrees % 15 !== 0) continue;
    const round = bearing(degrees);
    const isMain = round % 90 === 0;
    const text = svg("text", { class: isMain ? "compass-letter" : "compass-number", x, y: -21 });
    text.textContent = isMain ? (LETTERS[round / 90] ?? "") : String(round).padStart(3, "0");
    labels.push({ degrees, text });
  }
  strip.replaceChildren(svg("path", { class: "compass-ticks", d: path }), ...labels.map(({ text }) => text));
  return labels;
}

/**
 * @param {number} degrees
 * @param {number} radius
 */
function at(degrees, radius) {
  const radians = (degrees * Math.PI) / 180;
  return `${(radius * Math.sin(radians)).toFixed(2)} ${(-radius * Math.cos(radians)).toFixed(2)}`;
}
