// @ts-check
/** Bytes as people write them, and lines that were typed. No DOM. */

const MOST_BYTES = 512;
const MOST_LINES = 100;

/**
 * Return what was typed as pairs in lower case with a blank between them.
 *
 * @param {string} text pairs with blanks, commas or 0x between them, or nothing
 * @returns {{value: string} | {fault: "empty" | "odd" | "letters" | "long"}}
 */
export function pairsOf(text) {
  const digits = text.replace(/0x/gi, " ").replace(/[\s,]+/g, "").toLowerCase();
  if (digits === "") return { fault: "empty" };
  if (!/^[0-9a-f]+$/.test(digits)) return { fault: "letters" };
  if (digits.length % 2 === 1) return { fault: "odd" };
  if (digits.length > 2 * MOST_BYTES) return { fault: "long" };
  return { value: (digits.match(/../g) ?? []).join(" ") };
}

/** @param {string} text */
export function hexOf(text) {
  return [...new TextEncoder().encode(text)].map((byte) => byte.toString(16).padStart(2, "0")).join(" ");
}

/**
 * Return a text that does nothing to a terminal: control characters are shown, not obeyed.
 *
 * @param {string} text
 */
export function plain(text) {
  return text.replace(/[\u0000-\u001f\u007f-\u009f]/g, (sign) => {
    const code = sign.charCodeAt(0);
    return code < 0x20 ? String.fromCharCode(0x2400 + code) : "�";
  });
}

/** Lines that were typed, to be had again with the arrow keys. */
export class Typed {
  /** @param {unknown} kept as `lines` was */
  constructor(kept) {
    this.lines = Array.isArray(kept) ? kept.map(String).slice(-MOST_LINES) : [];
    this.place = this.lines.length;
    this.draft = "";
  }

  /** @param {string} line */
  add(line) {
    if (line && this.lines.at(-1) !== line) this.lines.push(line);
    if (this.lines.length > MOST_LINES) this.lines.shift();
    this.place = this.lines.length;
    this.draft = "";
  }

  /**
   * @param {-1 | 1} way
   * @param {string} now what stands in the field
   * @returns {string} what is to stand there
   */
  go(way, now) {
    if (this.place === this.lines.length) this.draft = now;
    this.place = Math.min(this.lines.length, Math.max(0, this.place + way));
    return this.lines[this.place] ?? this.draft;
  }
}
