// @ts-check
/**
 * Switches to another interface of the robot without a reload, so the connection and all values
 * stay. Held controls are released first.
 *
 * The server renders each interface as a whole page; this module extracts its grid. A URL therefore
 * shows the same interface, whether opened directly or by a switch.
 *
 * @typedef {object} Doors
 * @property {(reason: string) => void} letGo
 * @property {() => void} leave ends the current interface
 * @property {() => void} enter starts the new interface
 */
import { fetchPage } from "../core/server.js";
import { t } from "urc/kit";
import { part } from "./badge.js";

const FETCH_MS = 10_000;
/** Time limit for loading widget styles; after the limit, the page is shown without them. */
const STYLES_MS = 3000;
const KEPT_S = 365 * 24 * 3600;

export class Interfaces {
  /**
   * @param {ParentNode} root
   * @param {Doors} doors
   */
  constructor(root, doors) {
    this.doors = doors;
    this.stage = part(document, "[data-stage]");
    this.note = part(root, "[data-note]");
    const choice = part(root, "[data-interface-choice]");
    if (!(choice instanceof HTMLSelectElement)) throw new Error("the choice is no select");
    this.choice = choice;
    this.current = choice.value;
    /** URL of the page at the last switch, without the fragment. */
    this.address = addressed();
    /** Number of the last request; responses to earlier requests are ignored. */
    this.round = 0;
    keep(this.current);
    // If the page's own URL contains no interface, the history entry stores the current interface.
    history.replaceState({ url: this.url }, "");
    choice.addEventListener("change", () => void this.open(this.url, true));
    addEventListener("popstate", ({ state }) => this.moved(state?.url));
  }

  /**
   * Handle a step in the history; links within the page also cause steps.
   *
   * @param {string | undefined} url URL in the entry
   */
  moved(url) {
    if (addressed() !== this.address) void this.open(url ?? location.href, false);
    else if (!url) history.replaceState({ url: this.urlOf(this.current) }, ""); // as above
  }

  /** URL of the current interface. */
  get url() {
    return this.urlOf(this.choice.value);
  }

  /** @param {string} name */
  urlOf(name) {
    return [...this.choice.options].find(({ value }) => value === name)?.dataset["url"] ?? location.href;
  }

  /**
   * @param {string} url
   * @param {boolean} isNew whether to add a history entry
   */
  async open(url, isNew) {
    this.round += 1;
    const { round } = this;
    this.doors.letGo(t("another interface was opened"));
    this.note.textContent = "";
    try {
      const page = await fetched(url);
      await styled(page);
      if (round !== this.round) return;
      this.show(page);
    } catch (error) {
      if (round !== this.round) return;
      console.warn("URC: the interface could not be opened:", error);
      this.choice.value = this.current;
      this.note.textContent = t("The interface could not be opened: {reason}", {
        reason: error instanceof Error ? error.message : String(error),
      });
      return;
    }
    if (isNew) history.pushState({ url }, "", url);
    this.address = addressed();
    keep(this.current);
  }

  /** @param {Document} page */
  show(page) {
    const stage = part(page, "[data-stage]");
    const choice = part(page, "[data-interface-choice]");
    if (!(choice instanceof HTMLSelectElement)) throw new Error("the choice is no select");
    this.doors.leave();
    part(document, "[data-grid-style]").textContent = `@layer page{${stage.dataset["grid"] ?? ""}}`;
    this.stage.replaceChildren(...[...stage.childNodes].map((node) => document.importNode(node, true)));
    this.stage.scrollTop = 0;
    this.current = choice.value;
    this.choice.value = choice.value;
    document.title = page.title;
    this.doors.enter();
  }
}

/** Return the URL of the page without the fragment. */
function addressed() {
  return location.pathname + location.search;
}

/**
 * @param {string} url
 * @returns {Promise<Document>}
 */
async function fetched(url) {
  const address = new URL(url, location.href);
  address.searchParams.set("part", "");
  const { status, page } = await fetchPage(address, FETCH_MS).catch(() => {
    throw new Error(t("no connection to URC"));
  });
  if (status === 200 && page?.querySelector("[data-stage]")) return page;
  throw new Error(page?.querySelector("main p")?.textContent || `HTTP ${status}`);
}

/**
 * Add the missing styles of widgets, and wait until they have loaded.
 *
 * @param {Document} page
 */
async function styled(page) {
  const own = part(document, "[data-widget-styles]");
  const known = [...document.querySelectorAll("[data-widget-styles]")].map((el) => el.textContent);
  /** @type {string[]} */
  const wanted = JSON.parse(part(page, "[data-stage]").dataset["styles"] ?? "[]");
  const rules = wanted.map((url) => `@import url("${url}") layer(widgets);`);
  const missing = rules.filter((rule) => !known.some((text) => text?.includes(rule)));
  if (missing.length === 0) return;
  const style = document.createElement("style");
  style.nonce = own.nonce ?? "";
  style.dataset["widgetStyles"] = "";
  style.textContent = missing.join("\n");
  await new Promise((resolve) => {
    const alarm = setTimeout(resolve, STYLES_MS);
    const done = () => {
      clearTimeout(alarm);
      resolve(undefined);
    };
    style.addEventListener("load", done);
    style.addEventListener("error", done);
    document.head.append(style);
  });
}

/**
 * Store the interface as this device's choice for the next visit.
 *
 * @param {string} name
 */
function keep(name) {
  const path = location.pathname;
  document.cookie = `urc-interface=${encodeURIComponent(name)}; path=${path}; max-age=${KEPT_S}; samesite=strict`;
}
