// @ts-check
/**
 * The legend of a small plot, which the style sheet lays out as a grid: the values that fit, and the
 * number of the others. A tap on a view over a background enlarges the view; elsewhere, a tap on the
 * legend shows all values in place of the curves.
 */
import { style, write } from "urc/kit";

export class SmallLegend {
  /**
   * @param {HTMLElement} root element of the widget
   * @param {HTMLElement} list
   * @param {(count: number) => string} words number of the entries that do not fit, as text
   * @param {AbortSignal} signal
   */
  constructor(root, list, words, signal) {
    this.list = list;
    this.words = words;
    this.rest = document.createElement("li");
    this.rest.className = "plot-rest";
    this.rest.setAttribute("aria-hidden", "true");
    const sizes = new ResizeObserver(() => this.fit());
    sizes.observe(list);
    const tap = (/** @type {Event} */ { target }) => {
      if (target instanceof Element && target.closest("button")) return; // shows or hides a line
      const isAll = !root.hasAttribute("data-values") && this.rest.isConnected;
      root.toggleAttribute("data-values", isAll);
      this.fit();
    };
    list.addEventListener("click", tap, { signal });
    signal.addEventListener("abort", () => sizes.disconnect());
  }

  /** Replace the entries. @param {readonly HTMLElement[]} items */
  fill(items) {
    this.list.replaceChildren(...items);
    this.fit();
  }

  /** Show as many entries as fit, after a change of the size, the entries or their widths. */
  fit() {
    const { list, rest } = this;
    const items = [...list.children].filter((item) => item instanceof HTMLElement && item !== rest);
    const { display, maxHeight, lineHeight, columnGap } = getComputedStyle(list);
    const isSmall = display === "grid";
    for (const item of items) item.toggleAttribute("data-hidden", false);
    style(list, "--plot-columns", "1"); // as wide as they want to be: a narrow column shortens names
    let [shown, columns] = [items.length, 1];
    if (isSmall && list.clientWidth > 0) {
      const gap = parseFloat(columnGap) || 0;
      const widest = Math.max(1, ...items.map((item) => widthOf(item)));
      columns = Math.max(1, Math.floor((list.clientWidth + gap) / (widest + gap)));
      style(list, "--plot-columns", String(columns));
      const room = Math.round(parseFloat(maxHeight) / parseFloat(lineHeight)) * columns;
      if (items.length > room) shown = Math.max(1, room - 1);
    }
    rest.toggleAttribute("data-wide", false);
    this.show(items, shown);
    if (shown === items.length || !isCut(rest)) return;
    if (columns > 1 && shown > 1) {
      rest.toggleAttribute("data-wide", true); // its text takes the place of one more entry
      this.show(items, (shown -= 1));
    }
    if (isCut(rest)) write(rest, `+${items.length - shown}`);
  }

  /**
   * Show the first entries, and the number of the others.
   *
   * @param {readonly Element[]} items
   * @param {number} shown
   */
  show(items, shown) {
    const { list, rest } = this;
    items.forEach((item, place) => item.toggleAttribute("data-hidden", place >= shown));
    if (shown < items.length) {
      write(rest, this.words(items.length - shown));
      if (!rest.isConnected) list.append(rest);
    } else rest.remove();
  }
}

/** Return whether a text is wider than its place. @param {HTMLElement} el */
function isCut(el) {
  return el.scrollWidth > el.clientWidth;
}

/** Return the width of an entry's content in pixels. @param {Element} item */
function widthOf(item) {
  const parts = [...(item.firstElementChild?.children ?? [])];
  const widths = parts.map((part) => (part instanceof HTMLElement ? part.offsetWidth : 0)).filter((width) => width > 0);
  const gap = parseFloat(getComputedStyle(item.firstElementChild ?? item).columnGap) || 0;
  return widths.reduce((sum, width) => sum + width + gap, -gap);
}
