// @ts-check
/** Search in the menu: the cards that have each of the typed words stay visible. */
import { fits } from "./search.js";

const field = document.querySelector("[data-find-robot]");
const cards = [...document.querySelectorAll("[data-robot-card]")].filter((el) => el instanceof HTMLElement);
const none = document.querySelector("[data-no-match]");

if (field instanceof HTMLInputElement) {
  field.addEventListener("input", () => find(field.value));
  find(field.value); // the browser restores earlier input
}

/** @param {string} typed */
function find(typed) {
  let found = 0;
  for (const card of cards) {
    const said = [...card.querySelectorAll("h2, .urc-card-summary")].map((el) => el.textContent ?? "");
    card.hidden = !fits([card.dataset["robotCard"] ?? "", ...said].join(" "), typed);
    if (!card.hidden) found += 1;
  }
  if (none instanceof HTMLElement) none.hidden = found > 0;
}
