// @ts-check
/**
 * The strip under the bar, shown only during alarms: the most urgent alarm, its action, a button for
 * the command of this action, and the number of all alarms. A tap opens the list. The strip flashes
 * until the alarms are acknowledged.
 *
 * @typedef {import("./book.js").AlarmBook} AlarmBook
 * @typedef {import("./book.js").AlarmRow} AlarmRow
 * @typedef {import("../live/store.js").Store} Store
 */
import { SIGNS } from "../core/alarm_signs.js";
import { made } from "../core/dom.js";
import { t } from "../core/words.js";
import { attribute, write } from "../widgets/kit.js";
import { lineOf, moreAlarms, PRIORITIES } from "./phrases.js";

export class AlarmStrip {
  /**
   * @param {HTMLElement} el
   * @param {object} doors
   * @param {() => void} doors.open
   * @param {(row: AlarmRow) => void} doors.acknowledge
   * @param {(command: string) => HTMLElement | null} doors.buttonFor finds the page's button for a command
   */
  constructor(el, { open, acknowledge, buttonFor }) {
    this.el = el;
    this.buttonFor = buttonFor;
    this.sign = made("span", { class: "urc-alarm-sign", "aria-hidden": "true" });
    /** The name of the shape, for screen readers. */
    this.priority = made("span", { class: "urc-hidden" });
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
      made("span", { class: "urc-alarm-seen-short", "aria-hidden": "true" }, `✓ ${t("Seen")}`),
    );
    /** The page's button for the shown alarm's command. @type {HTMLElement | null} */
    this.helper = null;
    this.help = made("button", { class: "urc-button", type: "button", "data-alarm-help": true, onclick: () => this.helper?.click() });
    this.help.addEventListener("keydown", (event) => {
      if (event.repeat) event.preventDefault(); // a held key repeats its clicks; all these clicks count as one
    });
    const text = made("span", { class: "urc-alarm-text" }, this.line, this.action);
    this.open = made(
      "button",
      { class: "urc-alarm-open", type: "button", "data-alarm-open": true, "aria-expanded": "false", onclick: open },
      this.sign,
      this.priority,
      text,
      this.more,
    );
    el.append(this.open, this.help, this.seen);
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
    const priority = first.active ? t(PRIORITIES[first.priority] ?? first.priority) : "";
    write(this.priority, priority && `${priority}. `);
    attribute(this.sign, "title", priority || null);
    const line = lineOf(first, store, nowMs, false); // an age would change the height of the strip
    write(this.line, first.active ? line : t("{alarm}: back to normal", { alarm: line }));
    write(this.action, first.active ? first.action : "");
    write(this.more, moreAlarms(listed.length - 1));
    this.helper = first.active && first.command ? this.buttonFor(first.command) : null;
    this.help.hidden = this.helper === null;
    write(this.help, this.helper?.dataset["presses"] ?? "");
    this.seen.hidden = !mayAct || first.state === "acknowledged";
  }
}
