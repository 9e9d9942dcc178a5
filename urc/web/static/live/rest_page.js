// @ts-check
/**
 * The button for widgets that a small screen's grid lacks, with the list of their names.
 *
 * The end of the grid's page number selects them. The grid's rules place the cells, and show the
 * button only on screens that lack widgets: see `urc.web.show.layout`.
 */
import { part } from "./badge.js";
import { SIGNS } from "../core/alarm_signs.js";

/** @typedef {import("../core/types.js").AlarmPriority} AlarmPriority */

const REST = "-rest";
/** Screens whose bar has room for one short word. */
const NARROW = "(width < 37.5rem)";
/** @type {readonly AlarmPriority[]} */
const WORST_FIRST = ["high", "medium", "low"];

export class RestPage {
  /**
   * @param {ParentNode} root
   * @param {ParentNode} stage
   * @param {() => void} leave called before each change of the page
   * @param {AbortSignal} signal
   */
  constructor(root, stage, leave, signal) {
    this.button = part(root, "[data-rest]");
    this.list = part(root, "[data-rest-list]");
    this.stage = stage;
    this.leave = leave;
    const grid = stage.querySelector(".urc-grid");
    this.grid = grid instanceof HTMLElement ? grid : null;
    /** Cells that this screen's grid lacks, in reading order. @type {HTMLElement[]} */
    this.cells = [];
    /** Priority of the alarm of each signal. @type {ReadonlyMap<string, AlarmPriority>} */
    this.alarms = new Map();
    this.edition = -1;
    if (!this.grid) return; // the debug interface
    this.button.addEventListener("click", () => this.isRest && this.turn(), { signal });
    const changes = new MutationObserver(() => this.show()); // a tab changes the page, too
    changes.observe(this.grid, { attributeFilter: ["data-page"] });
    signal.addEventListener("abort", () => {
      changes.disconnect();
      this.list.hidePopover();
    });
    addEventListener("resize", () => this.show(), { signal }); // another screen may lack other widgets
    this.show();
  }

  get isRest() {
    return (this.grid?.dataset["page"] ?? "").endsWith(REST);
  }

  /** Switch between both pages. */
  turn() {
    if (!this.grid) return;
    this.leave();
    const number = (this.grid.dataset["page"] ?? "0").replace(REST, "");
    this.grid.dataset["page"] = this.isRest ? number : number + REST;
  }

  /** Mark widgets with an alarm. @param {import("../alarms/book.js").AlarmBook} book */
  mark(book) {
    if (!this.grid || book.edition === this.edition) return;
    this.edition = book.edition;
    this.alarms = book.active();
    this.show();
  }

  show() {
    const { button, list } = this;
    const numbers = getComputedStyle(button).getPropertyValue("--urc-rest").split(" ").filter(Boolean);
    this.cells = numbers.map((one) => this.stage.querySelector(`[data-cell="${one}"]`)).filter((el) => el instanceof HTMLElement);
    const { restBack = "", restAlarm = "" } = button.dataset;
    button.setAttribute("aria-pressed", String(this.isRest));
    if (this.isRest) button.removeAttribute("popovertarget");
    else button.setAttribute("popovertarget", list.id);
    if (this.isRest || this.cells.length === 0) list.hidePopover();
    const alarms = this.cells.map((cell) => worstOf(signalsOf(cell), this.alarms));
    list.replaceChildren(...this.cells.map((cell, at) => this.item(cell, alarms[at] ?? "")));
    const worst = this.isRest ? "" : WORST_FIRST.find((one) => alarms.includes(one)) ?? "";
    button.toggleAttribute("data-alarm", worst !== "");
    const words = this.words();
    button.textContent = this.isRest ? "←" : [words, worst && SIGNS[worst]].filter(Boolean).join(" ");
    const names = `${words}: ${this.cells.map(titleOf).join(", ")}`;
    const title = this.isRest ? restBack : worst ? `${names} · ${restAlarm}` : names;
    button.title = title;
    button.setAttribute("aria-label", title);
  }

  /** Return the interface's name for the missing widgets; else “More”, with their number where there is room. */
  words() {
    const more = this.button.dataset["restMore"] ?? "";
    if (matchMedia(NARROW).matches) return more;
    const drawers = new Set(this.cells.map((cell) => cell.closest("[data-drawer-name]")));
    const drawer = drawers.size === 1 ? [...drawers][0] : null;
    if (drawer instanceof HTMLElement) return drawer.dataset["drawerName"] ?? more;
    return `${more} (${this.cells.length})`;
  }

  /**
   * @param {HTMLElement} cell
   * @param {AlarmPriority | ""} alarm
   */
  item(cell, alarm) {
    const item = document.createElement("button");
    item.type = "button";
    item.className = "urc-button";
    item.toggleAttribute("data-alarm", alarm !== "");
    item.textContent = [alarm && SIGNS[alarm], titleOf(cell)].filter(Boolean).join(" ");
    item.addEventListener("click", () => {
      this.list.hidePopover();
      this.turn();
      cell.scrollIntoView({ block: "nearest" });
      this.button.focus();
    });
    return item;
  }
}

/**
 * Return the worst alarm of some signals; "" without an alarm.
 *
 * @param {readonly string[]} signals
 * @param {ReadonlyMap<string, AlarmPriority>} alarms
 * @returns {AlarmPriority | ""}
 */
export function worstOf(signals, alarms) {
  return WORST_FIRST.find((one) => signals.some((signal) => alarms.get(signal) === one)) ?? "";
}

/** @param {HTMLElement} cell */
function configOf(cell) {
  try {
    return JSON.parse(cell.dataset["config"] ?? "{}");
  } catch {
    return {}; // the widget says its fault
  }
}

/** @param {HTMLElement} cell */
function titleOf(cell) {
  const { title, slot } = configOf(cell);
  return String(title || slot || "");
}

/** @param {HTMLElement} cell @returns {string[]} */
function signalsOf(cell) {
  return Object.values(configOf(cell).inputs ?? {}).flat().map(String);
}
