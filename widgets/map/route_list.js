// @ts-check
/**
 * The list in which the operator edits a route: choose, move and delete waypoints, by hand or by keys.
 *
 * @typedef {import("./route.js").Route} Route
 */
import { attribute, button, write } from "urc/kit";

/**
 * @typedef {object} Row
 * @property {HTMLLIElement} item
 * @property {HTMLButtonElement} choose
 * @property {HTMLButtonElement} up
 * @property {HTMLButtonElement} down
 * @property {HTMLButtonElement} remove
 */

export class RouteList {
  /**
   * @param {{t: import("../../urc/web/static/core/types.js").Context["t"], signal: AbortSignal, route: () => Route, changed: () => void}} given
   *   `route` returns the edited route; `changed` is called after each change of it.
   */
  constructor({ t, signal, route, changed }) {
    this.t = t;
    this.signal = signal;
    this.route = route;
    this.changed = changed;
    this.element = document.createElement("ol");
    this.element.className = "map-route";
    this.element.setAttribute("aria-label", t("Waypoints"));
    /** @type {Row[]} */
    this.rows = [];
  }

  /**
   * Show the waypoints.
   *
   * @param {readonly string[]} texts one line for each waypoint
   * @param {boolean} isBusy whether nothing may be changed
   */
  show(texts, isBusy) {
    while (this.rows.length > texts.length) this.rows.pop()?.item.remove();
    while (this.rows.length < texts.length) this.addRow();
    const { chosen } = this.route();
    this.rows.forEach(({ choose, up, down, remove }, index) => {
      write(choose, `${index + 1} · ${texts[index] ?? ""}`);
      attribute(choose, "aria-pressed", String(index === chosen));
      attribute(choose, "disabled", isBusy ? "" : null);
      attribute(up, "disabled", isBusy || index === 0 ? "" : null);
      attribute(down, "disabled", isBusy || index === texts.length - 1 ? "" : null);
      attribute(remove, "disabled", isBusy ? "" : null);
    });
  }

  addRow() {
    const { t, signal } = this;
    const index = this.rows.length;
    const number = { number: index + 1 };
    const make = (/** @type {string} */ sign, /** @type {() => void} */ press, /** @type {string} */ label) =>
      button("map-button", sign, press, label ? { signal, label } : { signal });
    const row = {
      item: document.createElement("li"),
      choose: make("", () => this.choose(index), ""),
      up: make("↑", () => this.move(index, -1), t("Move waypoint {number} up", number)),
      down: make("↓", () => this.move(index, 1), t("Move waypoint {number} down", number)),
      remove: make("✕", () => this.remove(index), t("Delete waypoint {number}", number)),
    };
    row.choose.classList.add("map-waypoint");
    row.item.append(row.choose, row.up, row.down, row.remove);
    this.element.append(row.item);
    this.rows.push(row);
  }

  /** @param {number} index */
  choose(index) {
    this.route().choose(index);
    this.changed();
  }

  /**
   * Move a waypoint; the focus goes along with it.
   *
   * @param {number} index
   * @param {number} by
   */
  move(index, by) {
    if (!this.route().move(index, by)) return;
    this.changed();
    const row = this.rows[index + by];
    const same = by < 0 ? row?.up : row?.down;
    (same?.disabled ? row?.choose : same)?.focus();
  }

  /** Delete a waypoint; the focus goes to the next one. @param {number} index */
  remove(index) {
    this.route().remove(index);
    this.changed();
    this.rows[Math.min(index, this.rows.length - 1)]?.remove.focus();
  }

  /** Scroll to the chosen waypoint. */
  reveal() {
    this.rows[this.route().chosen]?.item.scrollIntoView({ block: "nearest" });
  }
}
