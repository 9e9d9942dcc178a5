// @ts-check
/** Sign-in with name and passphrase. */
import { ask, reason } from "../core/api_client.js";
import { ready } from "../core/dom.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";

const form = /** @type {HTMLFormElement} */ (part(document, "[data-sign-in]"));
const said = part(form, "[data-said]");
const name = /** @type {HTMLInputElement} */ (part(form, "[name=name]"));
const passphrase = /** @type {HTMLInputElement} */ (part(form, "[name=passphrase]"));
const submit = /** @type {HTMLButtonElement} */ (part(form, "[type=submit]"));

/** @param {string} text @param {"" | "bad"} [kind] */
function say(text, kind = "") {
  said.textContent = text && kind === "bad" ? `▲ ${text}` : text;
  said.classList.toggle("urc-bad", kind === "bad");
}

async function signIn() {
  const empty = [name, passphrase].find(({ value }) => !value.trim());
  if (empty) {
    say(t("Enter your name and your passphrase."), "bad");
    empty.focus();
    return;
  }
  submit.disabled = true;
  say(t("signing in …"));
  try {
    await ask("/api/v1/sign-in", { name: name.value, passphrase: passphrase.value });
    passphrase.value = "";
    // Not a reload, because after a link from another site, a reload would send no cookie either.
    location.replace(form.dataset["to"] ?? "/");
  } catch (error) {
    say(reason(error), "bad");
    passphrase.select();
    submit.disabled = false;
  }
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  void signIn();
});
ready(form);
