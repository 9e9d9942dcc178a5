// @ts-check
/** An invited person chooses a passphrase. */
import { ask, reason } from "../core/api_client.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";
import { rolesText, sayer, takenCode } from "./code.js";

const root = part(document, "[data-join]");
const say = sayer(root);
const form = /** @type {HTMLFormElement} */ (part(root, "[data-choose]"));
const first = /** @type {HTMLInputElement} */ (part(form, "[name=passphrase]"));
const again = /** @type {HTMLInputElement} */ (part(form, "[name=again]"));
const submit = /** @type {HTMLButtonElement} */ (part(form, "[type=submit]"));

let code = takenCode();

async function look() {
  if (!code) {
    say(t("Open the link in your invitation: the link contains a code."), "bad");
    return;
  }
  try {
    const { kind, name, roles } = await ask("/api/v1/codes", { code });
    if (kind !== "person") throw new Error(t("This code is for pairing a device: open the page “Pair this device”."));
    say("");
    part(form, "[data-right]").textContent = t("You are {name}. Your rights: {roles}.", { name, roles: rolesText(roles) });
    /** @type {HTMLInputElement} */ (part(form, "[name=username]")).value = name;
    form.hidden = false;
    first.focus();
  } catch (error) {
    say(reason(error), "bad");
  }
}

async function join() {
  if (first.value !== again.value) {
    say(t("The two passphrases differ."), "bad");
    again.focus();
    return;
  }
  submit.disabled = true;
  say(t("saving …"));
  try {
    await ask("/api/v1/join", { code, passphrase: first.value });
    first.value = again.value = "";
    location.replace("/");
  } catch (error) {
    say(reason(error), "bad");
    submit.disabled = false;
    first.focus();
  }
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  void join();
});
addEventListener("hashchange", () => {
  code = takenCode() || code;
  void look();
});
void look();
