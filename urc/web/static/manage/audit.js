// @ts-check
/**
 * The audit log page, with search fields and a table that loads older entries on demand. The page's
 * address contains the search, so that the search can be shared and reloaded.
 *
 * @typedef {import("../core/audit_entry.js").Entry} Entry
 */
import { ask, reason } from "../core/api_client.js";
import { detailsOf, levelOf, signOf, timeOf } from "../core/audit_entry.js";
import { made, ready } from "../core/dom.js";
import { mark, t } from "../core/words.js";
import { part } from "../live/badge.js";

const AT_ONCE = 100;
/** Typing pause before the search starts. */
const TYPING_MS = 300;
/** @type {Readonly<Record<string, string>>} */
const WAYS = {
  key: mark("start key"),
  pairing: mark("pairing"),
  passkey: mark("passkey"),
  passphrase: mark("passphrase"),
  oidc: mark("identity provider"),
  proxy: mark("proxy"),
  link: mark("guest link"),
  token: mark("token"),
  terminal: mark("terminal"),
};
/** @type {Readonly<Record<string, string>>} */
const ROLES = {
  watch: mark("may watch"),
  drive: mark("may drive"),
  maintain: mark("may maintain"),
  administer: mark("may administer"),
};

const root = part(document, "[data-audit]");
const filters = /** @type {HTMLDetailsElement} */ (part(root, "[data-filters]"));
const form = /** @type {HTMLFormElement} */ (part(root, "[data-search]"));
const summary = part(root, "[data-summary]");
const said = part(root, "[data-said]");
const table = part(root, "[data-table]");
const list = part(root, "[data-entries]");
const more = /** @type {HTMLButtonElement} */ (part(root, "[data-more]"));
const clear = /** @type {HTMLButtonElement} */ (part(root, "[data-clear]"));

/** Number of the last request; responses to earlier requests are ignored. */
let round = 0;
/** Number of the oldest shown entry. */
let oldest = 0;
let shown = 0;
/** @type {number | undefined} */
let typing;

/** @param {string} text @param {"" | "bad"} [kind] */
function say(text, kind = "") {
  said.textContent = text && kind === "bad" ? `▲ ${text}` : text;
  said.classList.toggle("urc-bad", kind === "bad");
}

/** @returns {[string, string][]} the filled fields */
function filled() {
  return [...new FormData(form)]
    .map(([name, value]) => /** @type {[string, string]} */ ([name, String(value).trim()]))
    .filter(([, value]) => value !== "");
}

/** @returns {URLSearchParams} the search in the server's format */
function query() {
  const asked = new URLSearchParams({ last: String(AT_ONCE) });
  for (const [name, value] of filled()) {
    const isTime = name === "since" || name === "until";
    const at = isTime ? new Date(value).getTime() / 1000 : 0;
    if (!isTime) asked.set(name, value);
    else if (at >= 0) asked.set(name, String(at));
  }
  return asked;
}

/** @param {boolean} isMore whether to add older entries to the shown ones */
async function load(isMore) {
  clearTimeout(typing);
  round += 1;
  const mine = round;
  const asked = query();
  if (isMore) asked.set("before", String(oldest));
  more.disabled = true;
  try {
    /** @type {{entries: Entry[], fault: string, hasMore: boolean}} */
    const { entries, fault, hasMore } = await ask(`/api/v1/audit?${asked}`);
    if (mine !== round) return;
    const rows = entries.map(row);
    if (isMore) list.append(...rows);
    else list.replaceChildren(...rows);
    shown = isMore ? shown + rows.length : rows.length;
    oldest = entries.at(-1)?.id ?? oldest;
    table.hidden = shown === 0;
    more.hidden = !hasMore;
    if (fault) say(t("new entries are not recorded: {why}", { why: fault }), "bad");
    else say(countText(hasMore));
  } catch (error) {
    if (mine === round) say(reason(error), "bad");
  } finally {
    if (mine === round) more.disabled = false;
  }
}

/** @param {boolean} hasMore */
function countText(hasMore) {
  if (shown === 0) return filled().length ? t("No entry matches the search.") : t("No entries yet.");
  if (hasMore) return t("the newest {count} entries", { count: shown });
  return shown === 1 ? t("1 entry") : t("{count} entries", { count: shown });
}

/** @param {Entry} entry */
function row(entry) {
  const [day, time] = timeOf(entry.at);
  const level = levelOf(entry.what);
  const details = detailsOf(entry);
  return made(
    "tr",
    { "data-what": entry.what, ...(level && { "data-level": level }) },
    made("td", { class: "urc-audit-time" }, made("time", { datetime: new Date(entry.at * 1000).toISOString() }, made("span", {}, day), " ", time)),
    made("td", { class: "urc-audit-what" }, t(signOf(entry.what))),
    made("td", { class: "urc-audit-robot" }, entry.robot),
    made("td", { class: "urc-audit-who" }, made("span", {}, entry.who || (entry.place ? t("unknown visitor") : "")), right(entry)),
    made(
      "td",
      { class: "urc-audit-details" },
      details.join(" · "),
      entry.data !== "" && made("code", {}, entry.data),
    ),
  );
}

/** @param {Entry} entry */
function right({ way, role, place }) {
  const parts = [way && t(WAYS[way] ?? way), role && t(ROLES[role] ?? role), place].filter(Boolean);
  return parts.length ? made("small", {}, parts.join(" · ")) : null;
}

/** Store the search in the page's address, and show that it restricts the list. */
function remember() {
  const asked = new URLSearchParams(filled());
  const text = asked.toString();
  history.replaceState(null, "", text ? `?${text}` : location.pathname);
  clear.hidden = text === "";
  const count = [...asked].length;
  summary.textContent = count === 0 ? "" : count === 1 ? t("1 filter") : t("{count} filters", { count });
}

/** @param {URLSearchParams} kept */
function fill(kept) {
  for (const el of form.elements) {
    if (el instanceof HTMLInputElement || el instanceof HTMLSelectElement) el.value = kept.get(el.name) ?? "";
    if (el instanceof HTMLSelectElement && el.selectedIndex < 0) el.value = "";
  }
}

function search() {
  remember();
  void load(false);
}

form.addEventListener("submit", (event) => {
  event.preventDefault();
  search();
});
form.addEventListener("input", () => {
  clearTimeout(typing);
  typing = window.setTimeout(search, TYPING_MS);
});
more.addEventListener("click", () => void load(true));
part(root, "[data-refresh]").addEventListener("click", () => void load(false));
clear.addEventListener("click", () => {
  fill(new URLSearchParams());
  search();
  part(root, "[data-refresh]").focus(); // this button is now hidden
});
fill(new URLSearchParams(location.search));
filters.open = window.matchMedia("(width >= 60rem)").matches;
ready(root);
search();
