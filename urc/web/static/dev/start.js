// @ts-check
/** The developer start page, with a button that reloads all documents and opens the robot. */
import { ask, reason } from "../core/api_client.js";
import { part } from "../live/badge.js";

for (const button of document.querySelectorAll("[data-start]")) {
  if (!(button instanceof HTMLButtonElement)) continue;
  const card = button.closest("[data-robot-card]");
  const said = card && part(card, "[data-said]");
  button.disabled = false;
  button.addEventListener("click", async () => {
    button.disabled = true;
    if (said) said.textContent = "";
    try {
      const { url } = await ask(button.dataset["start"] ?? "", {});
      location.assign(url);
    } catch (error) {
      if (said) said.textContent = `▲ ${reason(error)}`;
      button.disabled = false;
    }
  });
}
