// @ts-check
/**
 * The pairing of this device, with the code from the fragment or from input.
 *
 * @typedef {object} Info
 * @property {string} kind
 * @property {string} name
 * @property {string} suggested
 * @property {string} owner
 * @property {string[]} roles
 */
import { ask, reason } from "../core/api_client.js";
import { made } from "../core/dom.js";
import { t } from "../core/words.js";
import { part } from "../live/badge.js";
import { codeIn, rolesText, sayer, takenCode } from "./code.js";

const root = part(document, "[data-pair]");
const say = sayer(root);
const enter = /** @type {HTMLFormElement} */ (part(root, "[data-enter]"));
const named = /** @type {HTMLFormElement} */ (part(root, "[data-name]"));
const done = part(root, "[data-done]");
const field = /** @type {HTMLInputElement} */ (part(named, "[name=name]"));
const typed = /** @type {HTMLInputElement} */ (part(enter, "[name=code]"));

let code = takenCode();

/** @param {HTMLElement | null} step */
function show(step) {
  for (const one of [enter, named, done]) one.hidden = one !== step;
}

async function look() {
  if (!code) {
    show(enter);
    return;
  }
  say(t("checking the code …"));
  try {
    /** @type {Info} */
    const info = await ask("/api/v1/codes", { code });
    if (info.kind === "person") {
      location.replace(`/join#${encodeURIComponent(code)}`);
      return;
    }
    say("");
    part(named, "[data-right]").textContent = info.owner
      ? t("This device will belong to {name}, with these rights: {roles}.", { name: info.owner, roles: rolesText(info.roles) })
      : t("Its rights: {roles}.", { roles: rolesText(info.roles) });
    field.value = info.name || info.suggested;
    field.readOnly = Boolean(info.name);
    show(named);
  } catch (error) {
    say(reason(error), "bad");
    show(enter);
    typed.focus();
  }
}

async function pair() {
  const submit = /** @type {HTMLButtonElement} */ (part(named, "[type=submit]"));
  submit.disabled = true;
  say(t("pairing …"));
  try {
    const { name, check, robots } = await ask("/api/v1/pair", { code, name: field.value });
    say("");
    part(done, "[data-paired]").textContent = t("✓ This device is paired: {name}", { name });
    part(done, "[data-check]").textContent = check;
    const links = robots.map((/** @type {{title: string, url: string}} */ one) =>
      made("a", { class: "urc-button urc-button-main", href: one.url }, t("Connect to {title}", { title: one.title })));
    part(done, "[data-robots]").replaceChildren(...links, made("a", { class: "urc-button", href: "/" }, t("To the menu")));
    show(done);
  } catch (error) {
    say(reason(error), "bad");
    submit.disabled = false;
    field.focus();
  }
}

enter.addEventListener("submit", (event) => {
  event.preventDefault();
  code = codeIn(typed.value);
  void look();
});
named.addEventListener("submit", (event) => {
  event.preventDefault();
  void pair();
});
// The camera may open the link in a tab that already shows this page.
addEventListener("hashchange", () => {
  const next = takenCode();
  if (next) code = next;
  void look();
});
void look();
