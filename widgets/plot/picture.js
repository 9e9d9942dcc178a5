// @ts-check
/**
 * The picture of what was drawn: strips side by side, in a frame that moves to the left with the time.
 *
 * What is put into it changes the last strip or two, and one that has left the picture begins anew at
 * its other end. What is new goes on a narrow one that lies over them. Columns are pixels of the
 * screen since time 0.
 *
 * @typedef {object} Strip
 * @property {Sheet} sheet
 * @property {number} number Which one it is, counted from column 0; NaN: none yet.
 * @property {number} from First column that can be drawn on it.
 * @property {number} to The one after the last.
 * @property {boolean} isDrawn Whether there is something on it that is not shown yet.
 */
import { Sheet } from "urc/sheet";

/** So many strips are as wide as the picture. */
const STRIPS = 4;
/** Width of what is new, and how much of that lies before the column in which it begins, in CSS pixels. */
const NEW_PX = 48;
const BEFORE_PX = 16;

export class Picture {
  /** @param {HTMLElement} place */
  constructor(place) {
    this.place = place;
    // One more where the first and the last are seen in part, and one that begins at the right end.
    this.strips = Array.from({ length: STRIPS + 2 }, made);
    this.newest = made();
    this.all = [...this.strips, this.newest];
    place.replaceChildren(...this.all.map(({ sheet }) => sheet.canvas));
    this.width = 1;
    this.height = 1;
    this.density = 1;
    /** Columns of one strip; it is wider by `rim` at both ends, for lines have a width. */
    this.span = 1;
    this.rim = 0;
    /** Which column was at the right end when all were put in their places. */
    this.base = 0;
    this.shift = NaN;
  }

  /**
   * @param {number} width CSS pixels
   * @param {number} height
   * @param {number} density pixels of the screen in one of them
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

  /** Nothing is drawn any more. */
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
   * Return the strips on which something between two columns is drawn, of those that can be seen; the
   * canvas of one that has left the picture becomes the one that has come.
   *
   * @param {number} from
   * @param {number} to
   * @param {number} column at the right end
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
   * All is in the picture: what is new begins at this column. All are put in their places anew; the
   * numbers in there stay small in that way.
   *
   * @param {number} column at the right end
   */
  follow(column) {
    const { density, newest, rim } = this;
    this.clear(newest);
    newest.from = column - Math.round(BEFORE_PX * density);
    newest.to = newest.from + newest.sheet.canvas.width - rim;
    const left = column - this.width + 1;
    for (const { sheet, from } of this.all) sheet.canvas.style.transform = `translateX(${(from - left) / density}px)`;
    this.base = column;
    this.shift = NaN; // `show` says it anew
  }

  /**
   * Show what was drawn, with this column at the right end.
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
