// @ts-check
/** The buttons on the sign-in page for passkeys and for an identity provider. */
import { reason } from "../core/api_client.js";
import { ready } from "../core/dom.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";
import { signInWithPasskey, signInWithProvider } from "./passkey.js";

const root = part(document, "[data-further-ways]");
const said = part(root, "[data-way-said]");

/** @param {HTMLButtonElement} button @param {() => Promise<void>} go */
async function press(button, go) {
  button.disabled = true;
  said.classList.remove("urc-bad");
  said.textContent = t("signing in …");
  try {
    await go();
  } catch (error) {
    said.classList.add("urc-bad");
    said.textContent = `▲ ${reason(error)}`;
    button.disabled = false;
  }
}

/** @param {string} selector @param {() => Promise<void>} go */
function connect(selector, go) {
  const button = root.querySelector(selector);
  if (button instanceof HTMLButtonElement) button.addEventListener("click", () => void press(button, go));
}

connect("[data-passkey]", async () => {
  await signInWithPasskey();
  // Not a reload, because after a link from another site, a reload would send no cookie either.
  location.replace(root.dataset["to"] ?? "/");
});
connect("[data-provider]", signInWithProvider);
ready(root);
