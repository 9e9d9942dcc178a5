// @ts-check
/**
 * The captions and buttons of the background (elements with `data-floats`), moved up or down so that
 * no widget, STOP button or other float covers them.
 *
 * @typedef {{ left: number, top: number, right: number, bottom: number }} Box
 */

const GAP = 6;
/** Minimum time between two placements, in ms; the text of a caption changes often. */
const SOONEST_MS = 200;
const DOCK = ".urc-stop-button, .urc-who, .urc-verbs > *";

/**
 * Keep the floats of a stage free until `signal` ends.
 *
 * @param {HTMLElement} stage
 * @param {AbortSignal} signal
 */
export function keepFloatsFree(stage, signal) {
  let timer = 0;
  let placedMs = -Infinity;
  const sizes = new ResizeObserver(() => later());
  const place = () => {
    timer = 0;
    placedMs = performance.now();
    placeFloats(stage);
    for (const el of stage.querySelectorAll(".urc-cell, [data-floats]")) sizes.observe(el);
  };
  const later = () => {
    timer ||= setTimeout(place, Math.max(0, placedMs + SOONEST_MS - performance.now()));
  };
  const changes = new MutationObserver(later);
  sizes.observe(stage);
  changes.observe(stage, { subtree: true, attributeFilter: ["data-place", "data-page", "data-state", "hidden"] });
  later();
  signal.addEventListener("abort", () => {
    clearTimeout(timer);
    sizes.disconnect();
    changes.disconnect();
  });
}

/** @param {HTMLElement} stage */
function placeFloats(stage) {
  const isShown = (/** @type {Element} */ el) => el.checkVisibility() && el.getBoundingClientRect().width > 0;
  const floats = [...stage.querySelectorAll("[data-floats]")].filter((el) => el instanceof HTMLElement);
  for (const el of floats) el.style.transform = "";
  // On a phone in portrait, the widgets are below the background.
  if (!matchMedia("(width >= 37.5rem)").matches) return;
  const cells = [...stage.querySelectorAll('.urc-cell:not([data-place="ground"])'), ...document.querySelectorAll(DOCK)];
  /** @type {Box[]} */
  const taken = cells.filter(isShown).map((el) => el.getBoundingClientRect());
  const room = stage.getBoundingClientRect();
  for (const el of floats) {
    if (!el.closest('[data-place="ground"]') || !isShown(el) || !el.textContent?.trim()) continue;
    const box = el.getBoundingClientRect();
    const shift = freeShift(box, taken, room);
    if (shift) el.style.transform = `translateY(${shift}px)`;
    taken.push({ left: box.left, right: box.right, top: box.top + shift, bottom: box.bottom + shift });
  }
}

/**
 * Return the shortest vertical shift to a free place for a box; 0 without a free place.
 *
 * @param {Box} box
 * @param {readonly Box[]} taken the boxes that must stay visible
 * @param {Box} room the box stays in this area
 * @returns {number} shift in pixels; positive is down
 */
export function freeShift(box, taken, room) {
  const beside = taken.filter(({ left, right }) => left < box.right + GAP && right > box.left - GAP);
  const isFree = (/** @type {number} */ shift) => {
    const [top, bottom] = [box.top + shift, box.bottom + shift];
    if (shift && (top < room.top || bottom > room.bottom)) return false;
    return !beside.some((one) => one.top < bottom && one.bottom > top);
  };
  const shifts = beside.flatMap(({ top, bottom }) => [bottom + GAP - box.top, top - GAP - box.bottom]);
  shifts.sort((one, other) => Math.abs(one) - Math.abs(other));
  return [0, ...shifts].find(isFree) ?? 0;
}
