// @ts-check
/**
 * Back: what moves is let go and stopped, the controls are given back, then the page is left. The line
 * to the robot closes a moment later, when no other page looks at it.
 *
 * The link works without this, too: a page that goes away is stopped by the server. Here the stop is
 * seen through while somebody still looks.
 *
 * @typedef {object} Doors
 * @property {() => void} letGo lets go of whatever is held
 * @property {() => boolean} isMine whether this page has the controls
 * @property {() => void} leave gives them back, which stops the robot first
 * @property {() => void} close ends the page's line
 */

/** A server that does not answer by then is left all the same: it stops when the page is gone. */
const WITHIN_MS = 600;
const LOOK_MS = 20;

/**
 * @param {HTMLElement} link
 * @param {Doors} doors
 */
export function backSafely(link, doors) {
  let isLeaving = false;
  link.addEventListener("click", (event) => {
    // Another tab, another window: this page stays.
    if (event.defaultPrevented || event.button !== 0 || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    if (isLeaving || !(link instanceof HTMLAnchorElement)) return;
    isLeaving = true;
    doors.letGo();
    if (doors.isMine()) doors.leave();
    const untilMs = performance.now() + WITHIN_MS;
    const look = () => {
      if (doors.isMine() && performance.now() < untilMs) return void setTimeout(look, LOOK_MS);
      doors.close();
      location.assign(link.href);
    };
    look();
  });
  addEventListener("pageshow", () => {
    isLeaving = false;
  });
}
