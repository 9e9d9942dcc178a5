// @ts-check
/**
 * The strip under the bar, shown only during alarms: the most urgent alarm, its action, and the
 * number of all alarms. A tap opens the list. The strip flashes until the alarms are acknowledged.
 *
 * @typedef {import("./book.js").AlarmBook} AlarmBook
 * @typedef {import("./book.js").AlarmRow} AlarmRow
 * @typedef {import("../live/store.js").Store} Store
 */
import { made } from "../core/dom.js";
import { t } from "../core/words.js";
import { attribute, write } from "../widgets/kit.js";
import { lineOf, moreAlarms, SIGNS } from "./phrases.js";

export class AlarmStrip {
  /**
   * @param {HTMLElement} el
   * @param {{open: () => void, acknowledge: (row: AlarmRow) => void}} deeds
   */
  constructor(el, { open, acknowledge }) {
    this.el = el;
    this.sign = made("span", { class: "urc-alarm-sign", "aria-hidden": "true" });
    this.line = made("span", { class: "urc-alarm-line" });
    this.action = made("span", { class: "urc-alarm-action" });
    this.more = made("span", { class: "urc-alarm-more" });
    /**
     * The shown alarm, which is the only one that the strip acknowledges.
     *
     * @type {AlarmRow | undefined}
     */
    this.shown = undefined;
    const see = () => this.shown && acknowledge(this.shown);
    this.seen = made(
      "button",
      { class: "urc-button", type: "button", "data-alarm-seen": true, onclick: see, "aria-label": t("Acknowledge") },
      made("span", { class: "urc-alarm-seen-sign", "aria-hidden": "true" }, "✓"),
      made("span", { class: "urc-alarm-seen-word" }, t("Acknowledge")),
    );
    const text = made("span", { class: "urc-alarm-text" }, this.line, this.action);
    this.open = made(
      "button",
      { class: "urc-alarm-open", type: "button", "data-alarm-open": true, "aria-expanded": "false", onclick: open },
      this.sign,
      text,
      this.more,
    );
    el.append(this.open, this.seen);
  }

  /**
   * @param {AlarmBook} book
   * @param {Store} store
   * @param {number} nowMs
   * @param {boolean} mayAct
   */
  draw(book, store, nowMs, mayAct) {
    const listed = book.listed();
    const first = listed[0];
    this.shown = first;
    if (this.el.hidden !== !first) this.el.hidden = !first;
    if (!first) return;
    const { unacknowledged } = book.count();
    attribute(this.el, "data-priority", first.active ? first.priority : "");
    attribute(this.el, "data-flash", unacknowledged > 0 && first.active ? "true" : null);
    write(this.sign, first.active ? SIGNS[first.priority] : "✓");
    const line = lineOf(first, store, nowMs, false); // an age would change the height of the strip
    write(this.line, first.active ? line : t("{alarm}: back to normal", { alarm: line }));
    write(this.action, first.active ? first.action : "");
    write(this.more, moreAlarms(listed.length - 1));
    this.seen.hidden = !mayAct || first.state === "acknowledged";
  }
}
