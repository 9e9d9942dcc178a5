// @ts-check
/** A guest opens the robot of a guest link. */
import { ask, reason } from "../core/api_client.js";
import { ready } from "../core/dom.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";
import { sayer, takenCode } from "./code.js";

const root = part(document, "[data-guest]");
const say = sayer(root);
const button = /** @type {HTMLButtonElement} */ (part(root, "[data-watch]"));
const code = takenCode();

async function watch() {
  button.disabled = true;
  try {
    const { url } = await ask("/api/v1/guest", { code });
    location.replace(url);
  } catch (error) {
    say(reason(error), "bad");
    button.disabled = false;
  }
}

button.addEventListener("click", () => void watch());
if (code) ready(root);
else say(t("This link is incomplete."), "bad");
