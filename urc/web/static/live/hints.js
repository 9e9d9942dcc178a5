// @ts-check
/**
 * Hints about driving, stopping, turning the phone and swapping views, for the first visit with a
 * touch screen. They are shown once per device, below the bar, without covering anything. A tap on
 * their button ends them.
 */
import { t } from "../core/words.js";

const KEY = "urc-hints";
/** A phone in portrait. */
const UPRIGHT = "(width < 37.5rem) and (orientation: portrait)";

/**
 * Show the hints if this device has a touch screen and has not shown them yet.
 *
 * @param {HTMLElement} root the page
 */
export function offerHints(root) {
  const bands = root.querySelector("[data-bands]");
  if (!bands || !matchMedia("(pointer: coarse)").matches || wasSeen()) return;
  const lines = [
    root.querySelector('[data-footprint="stick"]') ? t("Hold a stick to drive. Let go to stop.") : "",
    root.querySelector("[data-stop-button]") ? t("STOP works at any time, even without control.") : "",
    root.querySelector(".urc-pip") ? t("Tap a small view to swap it with the large one.") : "",
    root.querySelector("[data-turned]") && matchMedia(UPRIGHT).matches ? t("Turn the phone for the full layout.") : "",
    t("Tap the connection symbol to see the connection's state and the log."),
  ].filter(Boolean);
  const card = document.createElement("section");
  card.className = "urc-hints";
  card.setAttribute("aria-label", t("Hints"));
  const list = document.createElement("ul");
  list.append(...lines.map((line) => Object.assign(document.createElement("li"), { textContent: line })));
  const button = document.createElement("button");
  button.type = "button";
  button.className = "urc-button urc-button-main";
  button.textContent = t("Got it");
  button.addEventListener("click", () => {
    remember();
    card.remove();
  });
  card.append(list, button);
  bands.before(card); // not over the stage, where controls are
}

function wasSeen() {
  try {
    return localStorage.getItem(KEY) !== null;
  } catch {
    return true; // without storage, show no hints, because they would appear at each visit
  }
}

function remember() {
  try {
    localStorage.setItem(KEY, "seen");
  } catch {
    // The browser forbids storage.
  }
}
