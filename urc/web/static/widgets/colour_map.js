// @ts-check
/**
 * Colour maps for measured fields: `import { palette } from "urc/colour_map"`.
 *
 * Cividis looks nearly the same with and without red-green blindness, and its brightness increases
 * from end to end, so it also works in grey. The map is from Nuñez, Anderton and Renslow (2018), at
 * every eighth step, with linear interpolation. The module uses no DOM.
 */

const CIVIDIS =
  "00224e 00285b 002e6a 053371 1a386f 273e6e 32436d 3b496c 434e6c 4b546c 535a6d 5a5f6e 61656f 686a71 " +
  "6f7073 767676 7d7c78 838179 8b8778 928d78 9a9376 a29975 aaa073 b3a670 bbad6d c3b369 ccba64 d4c15f " +
  "ddc858 e6d051 efd748 f8df3c fee838";
const STEPS = CIVIDIS.split(" ").map((text) => Number.parseInt(text, 16));

/** @typedef {"cividis" | "grey"} Palette */

/**
 * Return red, green and blue, 0 to 255.
 *
 * @param {number} share 0 to 1; values outside are clamped
 * @param {Palette} [name]
 * @returns {[number, number, number]}
 */
export function colour(share, name = "cividis") {
  const inside = Math.min(1, Math.max(0, share));
  if (name === "grey") {
    const level = Math.round(inside * 255);
    return [level, level, level];
  }
  const place = inside * (STEPS.length - 1);
  const below = Math.min(STEPS.length - 2, Math.floor(place));
  const rest = place - below;
  const [one, other] = [STEPS[below] ?? 0, STEPS[below + 1] ?? 0];
  const part = (/** @type {number} */ shift) =>
    Math.round(((one >> shift) & 255) * (1 - rest) + ((other >> shift) & 255) * rest);
  return [part(16), part(8), part(0)];
}

/**
 * Return the map in 256 steps, each as a pixel of `ImageData` in one 32-bit number.
 *
 * @param {Palette} [name]
 */
export function palette(name = "cividis") {
  const bytes = new Uint8ClampedArray(4 * 256);
  for (let step = 0; step < 256; step += 1) bytes.set([...colour(step / 255, name), 255], 4 * step);
  return new Uint32Array(bytes.buffer);
}

/**
 * Return a colour, as `rgb(1, 2, 3)` or `#123456`, as one pixel; black for any other text.
 *
 * @param {string} text
 * @param {number} [alpha] 0 to 255
 */
export function pixel(text, alpha = 255) {
  const bytes = new Uint8ClampedArray([...parts(text), alpha]);
  return new Uint32Array(bytes.buffer)[0] ?? 0;
}

/** @param {string} text */
function parts(text) {
  const hex = /^#([0-9a-f]{6})$/i.exec(text.trim());
  if (hex) {
    const number = Number.parseInt(hex[1] ?? "0", 16);
    return [number >> 16, (number >> 8) & 255, number & 255];
  }
  const numbers = /^rgba?\(([^)]*)\)$/i.exec(text.trim())?.[1]?.split(/[\s,/]+/).map(Number) ?? [];
  return [numbers[0] ?? 0, numbers[1] ?? 0, numbers[2] ?? 0];
}
