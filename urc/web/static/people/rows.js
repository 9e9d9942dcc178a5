// @ts-check
/**
 * Rows of the lists of people, devices, programs, guests and sign-ins.
 *
 * @typedef {object} Principal
 * @property {string} id
 * @property {"person" | "device" | "program" | "guest"} kind
 * @property {string} name
 * @property {string} owner
 * @property {string[]} roles
 * @property {string[]} commands
 * @property {boolean} hasPassphrase
 * @property {number} passkeys
 * @property {number} accounts
 * @property {number | null} invitedUntil
 * @property {number} signIns
 * @property {number | null} usedAt
 * @property {number | null} endsAt
 *
 * @typedef {object} SignIn
 * @property {string} id
 * @property {string} principal
 * @property {string} name
 * @property {string} kind
 * @property {string} way
 * @property {string} agent
 * @property {string} place
 * @property {number} createdAt
 * @property {number} usedAt
 * @property {number | null} endsAt
 * @property {boolean} isOwn
 */
import { made } from "../core/dom.js";
import { mark, t } from "../core/words.js";
import { rolesText } from "./code.js";

/** @type {Record<string, string>} */
const WAYS = {
  key: mark("printed address"),
  pairing: mark("paired device"),
  passkey: mark("passkey"),
  passphrase: mark("passphrase"),
  oidc: mark("identity provider"),
  proxy: mark("proxy"),
  link: mark("guest link"),
  token: mark("token"),
};

/** @param {number} utcS */
export function time(utcS) {
  const lang = document.documentElement.lang || "en";
  return new Date(utcS * 1000).toLocaleString(lang, { dateStyle: "medium", timeStyle: "short" });
}

/** @param {string} text */
export function quiet(text) {
  return made("li", { class: "urc-row urc-quiet" }, text);
}

/** @param {Principal} one @param {HTMLElement[]} buttons */
export function principalRow(one, buttons) {
  return made(
    "li",
    { class: "urc-row", "data-principal": one.name },
    made("h3", { class: "urc-row-title" }, one.name),
    made("p", {}, one.owner ? t("device of {name}", { name: one.owner }) : rolesText(one.roles)),
    one.commands.length > 0 && made("p", { class: "urc-small" }, t("only: {names}", { names: one.commands.join(", ") })),
    made("p", { class: "urc-small" }, facts(one).join(" · ")),
    made("div", { class: "urc-ways" }, ...buttons),
  );
}

/** @param {Principal} one @returns {string[]} */
function facts(one) {
  const used = one.usedAt ? t("last use {time}", { time: time(one.usedAt) }) : t("not used yet");
  const ends = one.endsAt ? [t("ends {time}", { time: time(one.endsAt) })] : [];
  if (one.kind === "person") return [...credentials(one), used];
  if (one.kind === "device" && !one.signIns) return [t("no longer paired")];
  return [used, ...ends];
}

/** @param {Principal} one @returns {string[]} */
function credentials(one) {
  const found = [];
  if (one.hasPassphrase) found.push(t("passphrase"));
  if (one.passkeys) found.push(t("passkey"));
  if (one.accounts) found.push(t("identity provider"));
  if (one.invitedUntil) found.push(t("invited until {time}", { time: time(one.invitedUntil) }));
  return found.length ? found : [t("cannot sign in yet: invite this person")];
}

/** @param {SignIn} one @param {HTMLElement[]} buttons @param {boolean} [isNamed] */
export function signInRow(one, buttons, isNamed = true) {
  const name = one.principal === "local" ? t("This computer") : one.name;
  const title = isNamed ? name : one.agent || t(WAYS[one.way] ?? one.way);
  const about = [t(WAYS[one.way] ?? one.way), isNamed && one.agent, one.place].filter(Boolean).join(" · ");
  const ends = one.endsAt ? ` · ${t("ends {time}", { time: time(one.endsAt) })}` : "";
  return made(
    "li",
    { class: "urc-row", "data-sign-in": one.id },
    made("h3", { class: "urc-row-title" }, title, one.isOwn && ` (${t("this browser")})`),
    made("p", {}, about),
    made("p", { class: "urc-small" }, t("last use {time}", { time: time(one.usedAt) }), ends),
    made("div", { class: "urc-ways" }, ...buttons),
  );
}
