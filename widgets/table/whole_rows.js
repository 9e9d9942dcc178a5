// @ts-check
/** The height of a table's visible part: whole rows, and the number of the rows below. */
import { write } from "urc/kit";

/** Height of the line with the number of rows below, in pixels. */
const MORE_PX = 20;

/**
 * Return the height of the visible part, in pixels.
 *
 * @param {number} room available height in pixels
 * @param {readonly number[]} ends lower ends of the rows, in pixels from the top of the table
 * @returns {number} the whole room if all rows or not even one row fits
 */
export function wholeHeight(room, ends) {
  if ((ends.at(-1) ?? 0) <= room) return room;
  return ends.filter((end) => end <= room - MORE_PX).at(-1) ?? room;
}

/**
 * Keep the visible part of a table at a number of whole rows.
 *
 * @param {{room: HTMLElement, scroll: HTMLElement, table: HTMLTableElement, more: HTMLElement}} parts
 * @param {(count: number) => string} words text for a number of rows below the visible part
 * @param {AbortSignal} signal
 */
export function keepWholeRows({ room, scroll, table, more }, words, signal) {
  let height = 0;
  const rows = () => [...(table.tBodies[0]?.rows ?? [])];
  const tell = () => {
    // Half a pixel, because browsers round the position of the scroll.
    const seen = scroll.scrollTop + height + 0.5;
    const below = rows().filter((row) => row.offsetTop + row.offsetHeight > seen).length;
    write(more, below > 0 ? words(below) : "");
  };
  const fit = () => {
    const space = room.clientHeight;
    height = wholeHeight(space, rows().map((row) => row.offsetTop + row.offsetHeight));
    const isCut = height < space;
    scroll.style.maxHeight = isCut ? `${height}px` : "";
    // At the end of the list too, the line keeps its place: otherwise, the rows would jump.
    more.hidden = !isCut;
    tell();
  };
  const sizes = new ResizeObserver(fit);
  sizes.observe(room);
  sizes.observe(table);
  scroll.addEventListener("scroll", tell, { signal, passive: true });
  signal.addEventListener("abort", () => sizes.disconnect());
}
