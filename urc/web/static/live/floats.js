// @ts-check
/**
 * The captions and buttons of the background, and the handle of the drawer (elements with
 * `data-floats`), moved so that no widget, STOP button, alarm or other float covers them.
 *
 * @typedef {{ left: number, top: number, right: number, bottom: number }} Box
 */

const GAP = 6;
/** Minimum time between two placements, in ms; the text of a caption changes often. */
const SOONEST_MS = 200;
const DOCK = ".urc-stop-button, .urc-who, .urc-take, .urc-verbs > *";
const STRIP = ".urc-alarm-strip";
/** Parts of the background that its captions must not cover, for example a question. */
const TAKEN = "[data-taken]";

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
  const strip = document.querySelector(STRIP);
  if (strip) sizes.observe(strip); // without a size while it is hidden
  later();
  signal.addEventListener("abort", () => {
    clearTimeout(timer);
    sizes.disconnect();
    changes.disconnect();
  });
}

const HANDLE = "[data-drawer-handle]";
/** The handle of the drawer chooses first. */
const buttonsIn = (/** @type {Element} */ el) => (el.matches(HANDLE) ? Infinity : el.querySelectorAll("button").length);
/** Whether a float is on the background. */
const isOnGround = (/** @type {Element} */ el) => el.matches(HANDLE) || el.closest('[data-place="ground"]') !== null;
/** Whether an open drawer contains a cell, so that the cell covers floats for a while. */
const isInDrawer = (/** @type {Element} */ el) => el.closest("[data-drawer][data-open]") !== null;

/** @param {HTMLElement} stage */
function placeFloats(stage) {
  const isShown = (/** @type {Element} */ el) => el.checkVisibility() && el.getBoundingClientRect().width > 0;
  // The buttons choose first: their places matter more than those of captions.
  const floats = [...stage.querySelectorAll("[data-floats]")].filter((el) => el instanceof HTMLElement);
  floats.sort((one, other) => buttonsIn(other) - buttonsIn(one));
  for (const el of floats) el.style.transform = "";
  // On a phone in portrait, the widgets are below the background.
  if (!matchMedia("(width >= 37.5rem)").matches) return;
  const cells = [...stage.querySelectorAll('.urc-cell:not([data-place="ground"])'), ...document.querySelectorAll(`${DOCK}, ${STRIP}, ${TAKEN}`)];
  /** @type {Box[]} */
  const taken = cells.filter((el) => isShown(el) && !isInDrawer(el)).map((el) => el.getBoundingClientRect());
  const room = stage.getBoundingClientRect();
  // The strip of an alarm can appear at the head of the stage, where it must cover no button.
  taken.push({ ...edges(room), bottom: room.top + (parseFloat(getComputedStyle(stage).paddingTop) || 0) - GAP });
  for (const el of floats) {
    if (!isOnGround(el) || !isShown(el) || !el.textContent?.trim()) continue;
    const box = el.getBoundingClientRect();
    const [x, y] = freeShift(box, taken, room);
    if (x || y) el.style.transform = `translate(${x}px, ${y}px)`;
    taken.push(moved(box, x, y));
  }
}

/**
 * Return the shortest shift to a free place for a box; none without a free place.
 *
 * @param {Box} box
 * @param {readonly Box[]} taken the boxes that must stay visible
 * @param {Box} room the box stays in this area
 * @returns {[number, number]} shift in pixels; positive is right and down
 */
export function freeShift(box, taken, room) {
  /** @type {number[]} */
  const across = [0];
  /** @type {number[]} */
  const along = [0];
  for (const { left, top, right, bottom } of taken) {
    across.push(right + GAP - box.left, left - GAP - box.right);
    along.push(bottom + GAP - box.top, top - GAP - box.bottom);
  }
  const isFree = (/** @type {[number, number]} */ [x, y]) => {
    const { left, top, right, bottom } = moved(box, x, y);
    if (x && (left < room.left || right > room.right)) return false;
    if (y && (top < room.top || bottom > room.bottom)) return false;
    return !taken.some((one) => one.left < right && one.right > left && one.top < bottom && one.bottom > top);
  };
  const shifts = across.flatMap((x) => along.map((y) => /** @type {[number, number]} */ ([x, y])));
  const distance = (/** @type {[number, number]} */ [x, y]) => Math.abs(x) + Math.abs(y);
  shifts.sort((one, other) => distance(one) - distance(other));
  return shifts.find(isFree) ?? [0, 0];
}

/**
 * @param {DOMRect} rect
 * @returns {Box}
 */
function edges({ left, top, right, bottom }) {
  return { left, top, right, bottom };
}

/**
 * @param {Box} box
 * @param {number} x
 * @param {number} y
 * @returns {Box}
 */
function moved({ left, top, right, bottom }, x, y) {
  return { left: left + x, top: top + y, right: right + x, bottom: bottom + y };
}
