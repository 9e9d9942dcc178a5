// @ts-check
/**
 * The pages of one interface, with a bar of tabs. One page is open.
 *
 * The pages share their cells, so a camera on two pages keeps running. The grid's rules place and
 * hide the cells by page number. Hidden cells get no data.
 */
import { part } from "./badge.js";

const STEPS = new Map([
  ["ArrowRight", 1],
  ["ArrowLeft", -1],
]);

export class Tabs {
  /**
   * @param {HTMLElement} bar
   * @param {HTMLElement} grid
   * @param {() => void} leave called before a change of the page
   */
  constructor(bar, grid, leave) {
    this.grid = grid;
    this.leave = leave;
    this.tabs = Array.from(bar.querySelectorAll("[role=tab]")).filter((el) => el instanceof HTMLElement);
    bar.addEventListener("click", (event) => {
      const tab = this.tabs.find((one) => event.target instanceof Node && one.contains(event.target));
      if (tab) this.open(tab);
    });
    bar.addEventListener("keydown", (event) => this.key(event));
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const last = this.tabs.length - 1;
    const place = this.tabs.findIndex((one) => one === event.target);
    const step = STEPS.get(event.key);
    /** @type {number | undefined} */
    let next;
    if (step !== undefined) next = (place + step + this.tabs.length) % this.tabs.length;
    else if (event.key === "Home") next = 0;
    else if (event.key === "End") next = last;
    const tab = next === undefined ? undefined : this.tabs[next];
    if (!tab || place < 0) return;
    event.preventDefault();
    this.open(tab);
    tab.focus();
  }

  /** @param {HTMLElement} tab */
  open(tab) {
    if (tab.getAttribute("aria-selected") === "true") return;
    this.leave();
    for (const one of this.tabs) {
      one.setAttribute("aria-selected", String(one === tab));
      one.tabIndex = one === tab ? 0 : -1;
    }
    this.grid.dataset["page"] = tab.dataset["number"] ?? "0";
    this.grid.setAttribute("aria-labelledby", tab.id);
    tab.scrollIntoView({ block: "nearest", inline: "nearest" });
    const address = new URL(location.href);
    address.searchParams.set("tab", tab.dataset["tab"] ?? "");
    history.replaceState(history.state, "", address);
  }
}

/**
 * Return the tabs of the current interface; null if it has no tabs.
 *
 * @param {ParentNode} root
 * @param {() => void} leave
 */
export function tabsOf(root, leave) {
  const bar = root.querySelector("[data-tabs]");
  return bar instanceof HTMLElement ? new Tabs(bar, part(root, ".urc-grid"), leave) : null;
}
