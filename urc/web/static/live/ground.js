// @ts-check
/**
 * The background of a page, and the views over it. A tap on a view swaps it with the background.
 * With the focus on a held control, the key V swaps the next view. Held controls stay held. The
 * device stores the choice.
 */
import { t } from "../core/words.js";

const KEY = "urc-ground:";

/**
 * Add the buttons of an interface's views, and restore the stored choice.
 *
 * @param {HTMLElement} stage
 */
export function swapViews(stage) {
  const ground = stage.querySelector('[data-place="ground"]');
  if (!(ground instanceof HTMLElement)) return;
  const views = [...stage.querySelectorAll('.urc-cell[data-footprint="view"]')].filter((one) => one instanceof HTMLElement);
  for (const view of views) addButton(view, views);
  const kept = stored();
  const chosen = views.find((one) => one.dataset["cell"] === kept);
  if (chosen) swap(chosen, ground);
  mark(views);
}

/**
 * Swap the background with the next view, from the keyboard while a key holds a stick.
 *
 * @param {HTMLElement} stage
 */
export function nextView(stage) {
  const views = [...stage.querySelectorAll('.urc-cell[data-footprint="view"]')];
  const at = views.findIndex((one) => one instanceof HTMLElement && one.dataset["place"] === "ground");
  const next = views[(at + 1) % views.length]?.querySelector(".urc-swap");
  if (at >= 0 && next instanceof HTMLElement) next.click();
}

/**
 * @param {HTMLElement} view
 * @param {HTMLElement[]} views
 */
function addButton(view, views) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "urc-swap";
  button.textContent = "⤢";
  button.setAttribute("aria-keyshortcuts", "V");
  const label = t("Show {title} large", { title: titleOf(view) });
  button.setAttribute("aria-label", label);
  button.title = label;
  button.addEventListener("click", () => {
    const ground = views.find((one) => one.dataset["place"] === "ground");
    if (!ground || ground === view) return;
    swap(view, ground);
    mark(views);
    store(view.dataset["cell"] ?? "");
  });
  view.append(button);
}

/** @param {HTMLElement} view */
function titleOf(view) {
  try {
    return String(JSON.parse(view.dataset["config"] ?? "{}").title ?? "");
  } catch {
    return "";
  }
}

/**
 * Exchange the places of two cells.
 *
 * @param {HTMLElement} one
 * @param {HTMLElement} other
 */
function swap(one, other) {
  const { place } = one.dataset;
  one.dataset["place"] = other.dataset["place"] ?? "";
  other.dataset["place"] = place ?? "";
}

/** Mark the views over the background. @param {HTMLElement[]} views */
function mark(views) {
  for (const view of views) view.classList.toggle("urc-pip", view.dataset["place"] !== "ground");
}

/** Storage key of the page and its interface. */
function key() {
  const choice = document.querySelector("[data-interface-choice]");
  return `${KEY}${location.pathname}${choice instanceof HTMLSelectElement ? choice.value : ""}`;
}

function stored() {
  try {
    return localStorage.getItem(key()) ?? "";
  } catch {
    return ""; // the browser forbids storage
  }
}

/** @param {string} cell */
function store(cell) {
  try {
    localStorage.setItem(key(), cell);
  } catch {
    // The browser forbids storage, so the choice lasts until the page closes.
  }
}
