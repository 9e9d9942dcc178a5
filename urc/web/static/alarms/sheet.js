// @ts-check
/**
 * The list of alarms as a sheet over the stage, below STOP: active alarms, hidden ones, and the history.
 *
 * @typedef {import("./actions.js").AlarmEvent} AlarmEvent
 * @typedef {import("./book.js").AlarmBook} AlarmBook
 * @typedef {import("./book.js").AlarmRow} AlarmRow
 * @typedef {import("../live/store.js").Store} Store
 *
 * @typedef {object} SheetDeeds
 * @property {(rows: AlarmRow[]) => void} acknowledge
 * @property {(signals: string[], minutes: number) => void} shelve
 * @property {(signals: string[]) => void} unshelve
 * @property {(query: {text: string, before: number, last: number}) => Promise<{events: AlarmEvent[], has_more: boolean, fault: string, lost: number}>} history
 * @property {(minutes: number) => void} mute Minutes; 0 ends the mute, Infinity has no end.
 * @property {() => boolean} isMuted
 * @property {() => void} closed
 */
import { SIGNS } from "../core/alarm_signs.js";
import { made, put } from "../core/dom.js";
import { inTurn } from "../core/formatting.js";
import { t } from "../core/words.js";
import { attribute, write } from "../widgets/kit.js";
import { SHELF_MINUTES } from "./actions.js";
import { byFirstOut, byUrgency, grouped } from "./book.js";
import { AlarmHistory } from "./history.js";
import { conditionText, leftText, lineOf, moreAlarms, PRIORITIES, STATES, titleOf } from "./phrases.js";

/**
 * Limit on displayed alarms; further alarms are only counted, so that a flood does not slow the
 * page down.
 */
const MOST_SHOWN = 100;

export class AlarmSheet {
  /**
   * @param {HTMLElement} parent
   * @param {SheetDeeds} deeds
   */
  constructor(parent, deeds) {
    this.deeds = deeds;
    this.isFirstOut = false;
    this.drawn = "";
    /** Opened bursts. @type {Set<number>} */
    this.opened = new Set();
    this.title = made("h2", { class: "urc-alarm-title", tabindex: "-1" }, t("Alarms"));
    this.order = this.button(t("Oldest first"), "order", () => {
      this.isFirstOut = !this.isFirstOut;
      attribute(this.order, "aria-pressed", String(this.isFirstOut));
      this.drawn = "";
    });
    attribute(this.order, "aria-pressed", "false");
    this.all = this.button(t("Acknowledge all"), "all", () => this.deeds.acknowledge(this.waiting));
    this.mute = made(
      "select",
      { class: "urc-input", "aria-label": t("Sound"), "data-alarm-mute": true, onchange: () => this.muted() },
      made("option", { value: "0" }, t("Sound on")),
      made("option", { value: "10" }, t("Mute 10 min")),
      made("option", { value: "60" }, t("Mute 1 h")),
      made("option", { value: "Infinity" }, t("Mute on this device")),
    );
    this.list = made("ul", { class: "urc-alarm-list", "data-alarm-list": true });
    this.hiddenTitle = made("h3", { class: "urc-alarm-part" }, t("Shelved and suppressed"));
    this.hiddenList = made("ul", { class: "urc-alarm-list", "data-alarm-hidden": true });
    this.note = made("p", { class: "urc-alarm-note", role: "status" });
    this.history = new AlarmHistory(deeds.history);
    this.el = made(
      "section",
      { class: "urc-alarm-sheet", role: "region", "aria-label": t("Alarms"), "data-alarm-sheet": true, hidden: true },
      made("div", { class: "urc-alarm-head" }, this.title, this.button(t("Close"), "close", () => this.close())),
      made("div", { class: "urc-alarm-tools" }, this.all, this.order, this.mute),
      this.note,
      made("p", { class: "urc-alarm-note", "data-alarm-legend": true }, legend()),
      this.list,
      this.hiddenTitle,
      this.hiddenList,
      this.history.el,
    );
    /** Visible unacknowledged alarms. @type {AlarmRow[]} */
    this.waiting = [];
    parent.append(this.el);
  }

  get isOpen() {
    return !this.el.hidden;
  }

  open() {
    const bar = document.querySelector("[data-alarm-strip]:not([hidden])") ?? document.querySelector(".urc-bar");
    const top = Math.max(0, bar?.getBoundingClientRect().bottom ?? 0);
    this.el.style.setProperty("--urc-alarm-top", `${Math.round(top)}px`);
    this.el.hidden = false;
    this.drawn = "";
    this.mute instanceof HTMLSelectElement && (this.mute.value = this.deeds.isMuted() ? "10" : "0");
    this.title.focus({ preventScroll: true });
  }

  close() {
    this.el.hidden = true;
    this.deeds.closed();
  }

  muted() {
    if (this.mute instanceof HTMLSelectElement) this.deeds.mute(Number(this.mute.value));
  }

  /**
   * @param {AlarmBook} book
   * @param {Store} store
   * @param {number} nowMs on the page's clock
   * @param {boolean} mayAct
   */
  draw(book, store, nowMs, mayAct) {
    if (!this.isOpen) return;
    const listed = book.listed().sort(this.isFirstOut ? byFirstOut : byUrgency);
    const groups = grouped(listed, book.isFlooded);
    const hidden = book.hidden();
    const serverMs = Date.now() + book.leadMs;
    this.say(book, listed.length);
    // The button elements are replaced only if more than values and times have changed.
    const look = JSON.stringify([book.edition, this.isFirstOut, mayAct, [...this.opened]]);
    if (look !== this.drawn) {
      this.drawn = look;
      put(this.list, this.rowsOf(groups, book, store, mayAct));
      put(this.hiddenList, hidden.slice(0, MOST_SHOWN).map((row) => this.row(row, book, store, mayAct)));
      this.hiddenTitle.hidden = hidden.length === 0;
      this.hiddenList.hidden = hidden.length === 0;
    }
    for (const item of this.el.querySelectorAll("[data-alarm]")) this.refresh(item, book, store, nowMs, serverMs);
  }

  /**
   * @param {AlarmBook} book
   * @param {number} count
   */
  say(book, count) {
    const words = count === 0 ? t("✓ no alarm") : count === 1 ? t("1 alarm") : t("{count} alarms", { count });
    const flood = t("Flood: more than 10 alarms in 10 minutes. The alarms of a burst are grouped, with the first alarm first.");
    write(this.note, book.isFlooded ? `${words}. ${flood}` : words);
  }

  /**
   * @param {AlarmRow[][]} groups
   * @param {AlarmBook} book
   * @param {Store} store
   * @param {boolean} mayAct
   */
  rowsOf(groups, book, store, mayAct) {
    /** @type {AlarmRow[]} */
    const sight = [];
    const items = [];
    let left = MOST_SHOWN;
    for (const group of groups) {
      if (left <= 0) break;
      const [first] = group;
      if (group.length === 1 && first) {
        sight.push(first);
        items.push(this.row(first, book, store, mayAct));
        left -= 1;
        continue;
      }
      const isOpen = this.opened.has(first?.group ?? -1);
      sight.push(...group); // its line contains their number
      items.push(this.burst(group, isOpen, store, mayAct));
      left -= 1;
      if (!isOpen) continue;
      for (const row of group.slice(0, left)) items.push(this.row(row, book, store, mayAct));
      left -= group.length;
    }
    this.waiting = sight.filter(({ state }) => state === "unacknowledged" || state === "returned");
    this.all.hidden = !mayAct || this.waiting.length < 2;
    write(this.all, t("Acknowledge all {count}", { count: this.waiting.length }));
    if (left < 0) items.push(made("li", { class: "urc-alarm-rest" }, moreAlarms(-left)));
    return items;
  }

  /**
   * @param {AlarmRow[]} group
   * @param {boolean} isOpen
   * @param {Store} store
   * @param {boolean} mayAct
   */
  burst(group, isOpen, store, mayAct) {
    const first = [...group].sort(byFirstOut)[0] ?? group[0];
    const number = first?.group ?? 0;
    const waiting = group.filter(({ state }) => state === "unacknowledged" || state === "returned");
    const toggle = made(
      "button",
      {
        class: "urc-alarm-open", type: "button", "data-key": `burst-${number}`, "aria-expanded": String(isOpen),
        onclick: () => {
          if (!this.opened.delete(number)) this.opened.add(number);
        },
      },
      made("span", { class: "urc-alarm-sign", "aria-hidden": "true" }, isOpen ? "▾" : "▸"),
      made(
        "span",
        { class: "urc-alarm-text" },
        made("span", { class: "urc-alarm-line" }, t("{count} alarms in one burst", { count: group.length })),
        made("span", { class: "urc-alarm-action" }, first ? t("first: {alarm}", { alarm: `${titleOf(first, store)}, ${conditionText(first.condition)}` }) : ""),
      ),
    );
    const see = () => this.deeds.acknowledge(waiting);
    const words = t("Acknowledge {count}", { count: waiting.length });
    const seen = mayAct && waiting.length > 0 && this.button(words, `see-burst-${number}`, see);
    const worst = [...group].sort(byUrgency)[0];
    return made("li", { class: "urc-alarm-burst", "data-burst": String(number), "data-priority": worst?.priority ?? "" }, toggle, seen);
  }

  /**
   * @param {AlarmRow} row
   * @param {AlarmBook} book
   * @param {Store} store
   * @param {boolean} mayAct
   */
  row(row, book, store, mayAct) {
    const { signal, state, cause, action, times, number, priority, active } = row;
    const who = state === "acknowledged" && row.acknowledged_by ? t("by {name}", { name: row.acknowledged_by }) : "";
    const more = [
      `${t(STATES[state] ?? state)} ${who}`.trim(),
      t(PRIORITIES[priority] ?? priority),
      t("since {time}", { time: timeOf(row.began - book.leadMs) }),
      t("number {number}", { number }),
      times > 1 && t("{count} times", { count: times }),
      !row.known && t("value unknown: the alarm stays active"),
    ].filter(Boolean);
    const isWaiting = state === "unacknowledged" || state === "returned";
    return made(
      "li",
      { class: "urc-alarm-item", "data-alarm": signal, "data-state": state, "data-priority": active ? priority : "", "data-known": String(row.known) },
      made("span", { class: "urc-alarm-sign", "aria-hidden": "true" }, active ? SIGNS[priority] : "✓"),
      made(
        "div",
        { class: "urc-alarm-text" },
        made("span", { class: "urc-alarm-line", "data-alarm-words": true }, lineOf(row, store, performance.now())),
        action && active && made("span", { class: "urc-alarm-action" }, `→ ${action}`),
        cause && made("span", { class: "urc-alarm-cause" }, cause),
        made("span", { class: "urc-alarm-more" }, more.join(" · ")),
        state === "shelved" && made("span", { class: "urc-alarm-more", "data-alarm-left": String(row.shelved_until) }),
      ),
      mayAct &&
        made(
          "div",
          { class: "urc-alarm-deeds" },
          isWaiting && this.button(t("Acknowledge"), `see-${signal}`, () => this.deeds.acknowledge([row])),
          state === "shelved"
            ? this.button(t("Unshelve"), `back-${signal}`, () => this.deeds.unshelve([signal]))
            : state !== "suppressed" && this.shelf(row, titleOf(row, store)),
        ),
    );
  }

  /**
   * @param {AlarmRow} row
   * @param {string} title
   */
  shelf({ signal }, title) {
    const choice = made(
      "select",
      {
        class: "urc-input", "data-key": `shelve-${signal}`, "aria-label": t("Shelve {title}", { title }),
        onchange: () => {
          const minutes = choice instanceof HTMLSelectElement ? Number(choice.value) : 0;
          if (minutes > 0) this.deeds.shelve([signal], minutes);
        },
      },
      made("option", { value: "" }, t("Shelve …")),
      ...SHELF_MINUTES.map((minutes) => made("option", { value: String(minutes) }, shelfText(minutes))),
    );
    return choice;
  }

  /**
   * @param {Element} item
   * @param {AlarmBook} book
   * @param {Store} store
   * @param {number} nowMs
   * @param {number} serverMs
   */
  refresh(item, book, store, nowMs, serverMs) {
    const row = book.rows.get(item.getAttribute("data-alarm") ?? "");
    const words = item.querySelector("[data-alarm-words]");
    if (row && words) write(words, lineOf(row, store, nowMs));
    const left = item.querySelector("[data-alarm-left]");
    if (row && left) {
      const age = leftText(row.shelved_until, serverMs);
      write(left, t("shelved by {name}, {time} left", { name: row.shelved_by, time: age }));
    }
  }

  /**
   * @param {string} text
   * @param {string} key
   * @param {() => void} act
   */
  button(text, key, act) {
    return made("button", { class: "urc-button", type: "button", "data-key": key, onclick: act }, text);
  }
}

/** Return the shape of each priority with its name, on one line if there is room. */
function legend() {
  return inTurn(Object.entries(SIGNS).map(([priority, sign]) => `${sign} ${t(PRIORITIES[priority] ?? priority)}`));
}

/** @param {number} minutes */
function shelfText(minutes) {
  return minutes < 60 ? t("for {count} min", { count: minutes }) : t("for {count} h", { count: minutes / 60 });
}

/** @param {number} atMs time of day of this device */
export function timeOf(atMs) {
  return new Date(atMs).toLocaleTimeString([], { hour12: false });
}
