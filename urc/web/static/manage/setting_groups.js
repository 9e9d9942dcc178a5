// @ts-check
/**
 * The groups of a settings form, for another driver version, which may declare other settings and
 * interfaces.
 *
 * @typedef {import("./setting_changes.js").SettingChanges} SettingChanges
 */
import { ready } from "../core/dom.js";
import { fetchPage } from "../core/server.js";
import { t } from "../core/words.js";

const FETCH_MS = 10_000;

/**
 * Replace the groups by those of the chosen driver version. Groups with the same title stay open or
 * closed, fields with the same name keep input that is not saved, and the choice of the version stays.
 *
 * @param {HTMLFormElement} form
 * @param {SettingChanges} changes of the form
 * @param {HTMLSelectElement} version
 * @throws {Error} with words for the operator, if the server does not send the settings
 */
export async function renewGroups(form, changes, version) {
  const fresh = await groupsOf(version.value);
  const typed = changes.unsaved().filter((field) => field !== version).map(({ name, value }) => ({ name, value }));
  const old = [...form.querySelectorAll("[data-group]")];
  const open = new Map(old.map((group) => [titleOf(group), group.hasAttribute("open")]));
  const groups = fresh.map((group) => document.importNode(group, true));
  for (const group of groups) group.toggleAttribute("open", open.get(titleOf(group)) ?? group.hasAttribute("open"));
  const hadFocus = version === document.activeElement;
  for (const group of groups) group.querySelector("[data-version]")?.replaceWith(version);
  old[0]?.before(...groups);
  for (const group of old) group.remove();
  ready(form);
  if (hadFocus) version.focus();
  for (const { name, value } of typed) {
    const field = form.elements.namedItem(name);
    if (field instanceof HTMLInputElement || field instanceof HTMLSelectElement) field.value = value;
  }
}

/**
 * @param {string} version "" is the newest
 * @returns {Promise<Element[]>}
 */
async function groupsOf(version) {
  const address = new URL(location.pathname, location.href);
  address.searchParams.set("version", version);
  const { status, page } = await fetchPage(address, FETCH_MS).catch(() => {
    throw new Error(t("no connection to URC"));
  });
  const found = [...(page?.querySelectorAll("[data-form] [data-group]") ?? [])];
  if (status !== 200 || found.length === 0) {
    throw new Error(page?.querySelector("main h1")?.textContent || `HTTP ${status}`);
  }
  return found;
}

/** @param {Element} group */
function titleOf(group) {
  return group.querySelector("summary > span")?.textContent ?? "";
}
