// @ts-check
/**
 * Buttons of the background in the bar. Between the widgets over a background, no place is free on
 * every screen; in the bar, each button has the same place always. A widget marks its buttons with
 * `data-bar-tools`. On a phone in portrait, they stay in the widget.
 */

const WIDE = "(width >= 37.5rem)";
/** The place of each group in its widget. @type {WeakMap<Element, Comment>} */
const HOMES = new WeakMap();

/**
 * Put the buttons of the present background into the bar, and all others back into their widgets.
 *
 * @param {HTMLElement} bar the place in the bar
 * @param {HTMLElement} stage
 */
export function placeBarTools(bar, stage) {
  const isWide = matchMedia(WIDE).matches;
  const groups = [...bar.querySelectorAll("[data-bar-tools]"), ...stage.querySelectorAll("[data-bar-tools]")];
  for (const group of groups) {
    const home = HOMES.get(group) ?? homeOf(group);
    const isGround = home.parentElement?.closest('[data-place="ground"]') != null;
    const isInBar = group.parentElement === bar;
    // An empty group stays: a widget that is still loading looks for it there.
    if (isGround && isWide && !isInBar && group.childElementCount > 0) bar.append(group);
    else if (!(isGround && isWide) && isInBar) home.after(group);
  }
}

/**
 * Keep the buttons in their places until `signal` ends: after a swap of views, and on a turned screen.
 *
 * @param {HTMLElement} bar
 * @param {HTMLElement} stage
 * @param {AbortSignal} signal
 */
export function keepBarTools(bar, stage, signal) {
  const place = () => placeBarTools(bar, stage);
  const wide = matchMedia(WIDE);
  const changes = new MutationObserver(place);
  changes.observe(stage, { subtree: true, attributeFilter: ["data-place"] });
  for (const group of stage.querySelectorAll("[data-bar-tools]")) changes.observe(group, { childList: true });
  wide.addEventListener("change", place, { signal });
  signal.addEventListener("abort", () => {
    changes.disconnect();
    bar.replaceChildren();
  });
  place();
}

/** @param {Element} group */
function homeOf(group) {
  const home = document.createComment("");
  group.before(home);
  HOMES.set(group, home);
  return home;
}
