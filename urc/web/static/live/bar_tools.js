// @ts-check
/**
 * Buttons of the background in the bar. Between the widgets over a background, no place is free on
 * every screen; in the bar, each button has the same place always. A widget marks its buttons with
 * `data-bar-tools`. On a phone in portrait, they stay in the widget; on a small one, whose picture is
 * low, they are under “This device”.
 */

const WIDE = "(width >= 37.5rem)";
const SMALL = "(width < 37.5rem) and (height < 46rem)";
/** The place of each group in its widget. @type {WeakMap<Element, Comment>} */
const HOMES = new WeakMap();

/**
 * Put the buttons of the present background into the bar or the menu, and all others back into their
 * widgets.
 *
 * @param {HTMLElement} bar the place in the bar
 * @param {HTMLElement} menu the place under “This device”
 * @param {HTMLElement} stage
 */
export function placeBarTools(bar, menu, stage) {
  const away = matchMedia(WIDE).matches ? bar : matchMedia(SMALL).matches ? menu : null;
  const groups = [bar, menu, stage].flatMap((place) => [...place.querySelectorAll("[data-bar-tools]")]);
  for (const group of groups) {
    const home = HOMES.get(group) ?? homeOf(group);
    const isGround = home.parentElement?.closest('[data-place="ground"]') != null;
    const isHome = group.parentElement !== bar && group.parentElement !== menu;
    // An empty group stays: a widget that is still loading looks for it there.
    if (isGround && away && (!isHome || group.childElementCount > 0)) {
      if (group.parentElement !== away) away.append(group);
    } else if (!isHome) home.after(group);
  }
}

/**
 * Keep the buttons in their places until `signal` ends: after a swap of views, and on a turned screen.
 *
 * @param {HTMLElement} bar
 * @param {HTMLElement} menu
 * @param {HTMLElement} stage
 * @param {AbortSignal} signal
 */
export function keepBarTools(bar, menu, stage, signal) {
  const place = () => placeBarTools(bar, menu, stage);
  const changes = new MutationObserver(place);
  changes.observe(stage, { subtree: true, attributeFilter: ["data-place"] });
  for (const group of stage.querySelectorAll("[data-bar-tools]")) changes.observe(group, { childList: true });
  for (const screen of [WIDE, SMALL]) matchMedia(screen).addEventListener("change", place, { signal });
  signal.addEventListener("abort", () => {
    changes.disconnect();
    bar.replaceChildren();
    menu.replaceChildren();
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
