// @ts-check
/**
 * The Back link: stop all motion, release control, then leave the page. The robot disconnects a
 * moment later, unless another page watches it.
 *
 * The link also works without this module, because the server stops the robot when its page closes.
 * With the module, the operator sees the stop before leaving.
 *
 * @typedef {object} Doors
 * @property {() => void} letGo releases all held controls
 * @property {() => boolean} isMine whether this page has the controls
 * @property {() => void} leave releases control, which first stops the robot
 * @property {() => void} close closes the page's socket
 */

/**
 * Time limit for the server's reply; without a reply, the page is left anyway, and the server stops
 * the robot.
 */
const WITHIN_MS = 600;
const LOOK_MS = 20;

/**
 * @param {HTMLElement} link
 * @param {Doors} doors
 */
export function backSafely(link, doors) {
  let isLeaving = false;
  link.addEventListener("click", (event) => {
    // Opens in another tab or window: this page stays.
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
