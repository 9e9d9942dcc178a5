// @ts-check
/** Common parts of the pages for links with a code and of the pages about people. */
import { part } from "../live/badge.js";
import { mark, t } from "../core/words.js";

/** @type {Record<string, string>} */
const ROLES = {
  watch: mark("watch"),
  drive: mark("drive"),
  maintain: mark("maintain"),
  administer: mark("administer"),
};

/** Return the code in the fragment of the address, and remove it from the address bar and the history. */
export function takenCode() {
  const code = codeIn(location.hash);
  if (code) history.replaceState(null, "", location.pathname);
  return code;
}

/** Return the code of a link, or the code itself. @param {string} text */
export function codeIn(text) {
  return decodeURIComponent((text.split("#").pop() ?? "").trim());
}

/**
 * @param {HTMLElement} root element with a line for messages
 * @returns {(text: string, kind?: "" | "bad") => void}
 */
export function sayer(root) {
  const said = part(root, "[data-said]");
  return (text, kind = "") => {
    said.textContent = text && kind === "bad" ? `▲ ${text}` : text;
    said.classList.toggle("urc-bad", kind === "bad");
  };
}

/** Return a right in words, such as “drive: cart”. @param {string} grant */
export function roleText(grant) {
  const [role = "", scope = ""] = grant.split("@");
  const word = t(ROLES[role] ?? role);
  if (!scope) return t("{role}, all robots", { role: word });
  if (scope.startsWith("#")) return t("{role}, robots with the tag {tag}", { role: word, tag: scope.slice(1) });
  return t("{role}, {robot}", { role: word, robot: scope });
}

/** @param {readonly string[]} grants */
export function rolesText(grants) {
  return grants.length ? grants.map(roleText).join("; ") : t("no role");
}
