// @ts-check
/** Bytes as text, and the history of typed lines. Pure: no DOM. */

const MOST_BYTES = 512;
const MOST_LINES = 100;

/**
 * Return the input as pairs of hex digits in lower case, separated by blanks.
 *
 * @param {string} text pairs, optionally separated by blanks, commas or 0x
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
 * Return a text that has no effect on a terminal, because control characters become visible.
 *
 * @param {string} text
 */
export function plain(text) {
  return text.replace(/[\u0000-\u001f\u007f-\u009f]/g, (sign) => {
    const code = sign.charCodeAt(0);
    return code < 0x20 ? String.fromCharCode(0x2400 + code) : "�";
  });
}

/** The history of typed lines, for the arrow keys. */
export class Typed {
  /** @param {unknown} kept an earlier value of `lines` */
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
   * @param {string} now present text of the field
   * @returns {string} new text of the field
   */
  go(way, now) {
    if (this.place === this.lines.length) this.draft = now;
    this.place = Math.min(this.lines.length, Math.max(0, this.place + way));
    return this.lines[this.place] ?? this.draft;
  }
}
