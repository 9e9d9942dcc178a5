// @ts-check
/**
 * The picture of the traces: strips side by side, in a frame that moves to the left with time.
 *
 * New data changes the last one or two strips. A strip that has left the picture is reused at the other
 * end. The newest data is drawn on a narrow strip above them. Columns are screen pixels since time 0.
 *
 * @typedef {object} Strip
 * @property {Sheet} sheet
 * @property {number} number Number of the strip, counted from column 0; NaN if unused.
 * @property {number} from First column that fits on the strip.
 * @property {number} to Column after the last column of the strip.
 * @property {boolean} isDrawn Whether the strip has content that is not shown yet.
 */
import { Sheet } from "urc/offscreen_canvas";

/** Number of strips in the width of the picture. */
const STRIPS = 4;
/** Width of the narrow strip, and of its part before the first column, in CSS pixels. */
const NEW_PX = 48;
const BEFORE_PX = 16;

export class Picture {
  /** @param {HTMLElement} place */
  constructor(place) {
    this.place = place;
    // Two additional strips: the first and last strips can be partly visible, and one starts at the right end.
    this.strips = Array.from({ length: STRIPS + 2 }, made);
    this.newest = made();
    this.all = [...this.strips, this.newest];
    place.replaceChildren(...this.all.map(({ sheet }) => sheet.canvas));
    this.width = 1;
    this.height = 1;
    this.density = 1;
    /** Columns of one strip. The strip is wider by `rim` at both ends, because lines have a width. */
    this.span = 1;
    this.rim = 0;
    /** Column at the right end at the last placement of the strips. */
    this.base = 0;
    this.shift = NaN;
  }

  /**
   * @param {number} width CSS pixels
   * @param {number} height
   * @param {number} density screen pixels for each CSS pixel
   */
  resize(width, height, density) {
    const pixels = (/** @type {number} */ length) => Math.max(1, Math.round(length * density));
    [this.width, this.height, this.density] = [pixels(width), pixels(height), density];
    this.span = Math.ceil(this.width / STRIPS);
    this.rim = Math.ceil(2 * density);
    for (const strip of this.all) {
      const across = strip === this.newest ? pixels(NEW_PX) : this.span + 2 * this.rim;
      strip.sheet.resize(across, this.height);
      strip.sheet.canvas.style.width = `${across / density}px`;
    }
  }

  /** Clear the picture. */
  wipe() {
    for (const strip of this.all) {
      strip.number = NaN;
      this.clear(strip);
    }
  }

  /** @param {Strip} strip */
  clear(strip) {
    const { pen, canvas } = strip.sheet;
    pen.clearRect(0, 0, canvas.width, canvas.height);
    strip.isDrawn = true;
  }

  /**
   * Return the visible strips between two columns, ready for drawing. A strip that has left the picture
   * is cleared and reused.
   *
   * @param {number} from
   * @param {number} to
   * @param {number} column column at the right end
   */
  between(from, to, column) {
    const { rim, span, strips } = this;
    const first = Math.floor((Math.max(from, column - this.width) - rim) / span);
    const last = Math.floor((Math.min(to, column) + rim) / span);
    const found = [];
    for (let number = first; number <= last; number += 1) {
      const strip = /** @type {Strip} */ (strips.at(number % strips.length));
      if (strip.number !== number) this.clear(strip);
      Object.assign(strip, { number, from: number * span - rim, to: (number + 1) * span + rim });
      found.push(strip);
    }
    return found;
  }

  /**
   * Start new data at this column, after all earlier data is in the picture. The strips are placed
   * again, which keeps their coordinates small.
   *
   * @param {number} column column at the right end
   */
  follow(column) {
    const { density, newest, rim } = this;
    this.clear(newest);
    newest.from = column - Math.round(BEFORE_PX * density);
    newest.to = newest.from + newest.sheet.canvas.width - rim;
    const left = column - this.width + 1;
    for (const { sheet, from } of this.all) sheet.canvas.style.transform = `translateX(${(from - left) / density}px)`;
    this.base = column;
    this.shift = NaN; // forces the next `show`
  }

  /**
   * Show the drawing, with this column at the right end.
   *
   * @param {number} column
   */
  show(column) {
    for (const strip of this.all) {
      if (strip.isDrawn) strip.sheet.show(true);
      strip.isDrawn = false;
    }
    const shift = column - this.base;
    if (shift === this.shift) return;
    this.shift = shift;
    this.place.style.transform = shift === 0 ? "" : `translateX(${-shift / this.density}px)`;
  }
}

/** @returns {Strip} */
function made() {
  const canvas = document.createElement("canvas");
  canvas.className = "plot-strip";
  return { sheet: new Sheet(canvas), number: NaN, from: 0, to: 0, isDrawn: false };
}
