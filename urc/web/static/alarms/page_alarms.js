// @ts-check
/**
 * The alarms of a robot's page: strip, sheet, sound, title of the document, and the announcement for
 * screen readers. Widgets use the same list.
 *
 * @typedef {import("../core/types.js").Alert} Alert
 * @typedef {import("../core/types.js").Lease} Lease
 * @typedef {import("../live/store.js").Store} Store
 * @typedef {import("./book.js").AlarmRow} AlarmRow
 * @typedef {import("./book.js").AlarmsMessage} AlarmsMessage
 */
import { SIGNS } from "../core/alarm_signs.js";
import { reason } from "../core/api_client.js";
import { t } from "../core/words.js";
import { AlarmActions } from "./actions.js";
import { AlarmBook, levelOf } from "./book.js";
import { readyButton } from "./buttons.js";
import { lineOf, moreAlarms, stateWords, titleOf } from "./phrases.js";
import { AlarmSheet } from "./sheet.js";
import { ALWAYS, AlarmSound } from "./sound.js";
import { AlarmStrip } from "./strip.js";

/** Minimum time between two announcements to a screen reader. */
const SAY_EVERY_MS = 3000;
const MAY_ACT = new Set(["drive", "maintain", "administer"]);

export class PageAlarms {
  /**
   * @param {object} page
   * @param {HTMLElement} page.root
   * @param {HTMLElement} page.strip
   * @param {HTMLElement} page.said an element with role alert
   * @param {Store} page.store
   * @param {string} page.path path of the robot's alarms in the API
   * @param {() => Lease | null} page.lease
   * @param {() => void} page.wake
   * @param {(text: string) => void} page.tell shows a line to the operator
   */
  constructor({ root, strip, said, store, path, lease, wake, tell }) {
    this.store = store;
    this.said = said;
    this.lease = lease;
    this.wake = wake;
    this.tell = tell;
    this.book = new AlarmBook();
    this.actions = new AlarmActions(path);
    this.sound = new AlarmSound(storage());
    this.title = document.title;
    /** New alarms that have not been announced yet. @type {Map<string, AlarmRow>} */
    this.fresh = new Map();
    this.saidMs = -Infinity;
    /** @type {number | undefined} */
    this.timer = undefined;
    this.sheet = new AlarmSheet(root, {
      acknowledge: (rows) => void this.acknowledge(rows),
      shelve: (signals, minutes) => this.shelve(signals, minutes),
      unshelve: (signals) => void this.act(this.actions.unshelve(signals)),
      history: (query) => this.actions.history(query),
      mute: (minutes) => this.mute(minutes),
      isMuted: () => this.sound.isMuted(Date.now()),
      closed: () => this.closed(),
    });
    this.strip = new AlarmStrip(strip, {
      open: () => (this.sheet.isOpen ? this.sheet.close() : this.open()),
      acknowledge: (row) => void this.acknowledge([row]),
      buttonFor: (command) => readyButton(root, command),
    });
    root.addEventListener("click", (event) => {
      // A press in the sheet may reorder the list or open a burst.
      if (event.target instanceof Node && this.sheet.el.contains(event.target)) wake();
    });
  }

  /** @param {AlarmsMessage} message */
  take(message) {
    const nowMs = Date.now();
    const fresh = this.book.take(message, nowMs);
    this.sheet.history.refresh();
    if (fresh.length === 0) return;
    this.sound.announce(fresh.some(({ priority }) => priority === "high"), this.book.isFlooded, nowMs);
    for (const row of fresh) this.fresh.set(row.signal, row);
    this.announce();
  }

  /** After a reconnect, the server sends the whole list again. */
  clear() {
    this.book.clear();
  }

  /** Announce new alarms in one sentence, and only as often as a screen reader can speak. */
  announce() {
    clearTimeout(this.timer);
    const leftMs = this.saidMs + SAY_EVERY_MS - performance.now();
    if (leftMs > 0) {
      this.timer = window.setTimeout(() => this.announce(), leftMs);
      return;
    }
    const rows = [...this.fresh.values()];
    this.fresh.clear();
    if (rows.length === 0) return;
    this.saidMs = performance.now();
    const first = rows[0];
    const line = first ? lineOf(first, this.store, performance.now()) : "";
    const more = moreAlarms(rows.length - 1);
    this.said.textContent = [line, first?.action, more].filter(Boolean).join(". ");
  }

  open() {
    this.sheet.open();
    this.strip.open.setAttribute("aria-expanded", "true");
    this.wake();
  }

  closed() {
    this.strip.open.setAttribute("aria-expanded", "false");
    if (!this.strip.el.hidden) this.strip.open.focus();
  }

  /** @param {number} minutes */
  mute(minutes) {
    this.sound.mute(minutes === Infinity ? ALWAYS : minutes > 0 ? Date.now() + 60_000 * minutes : 0);
  }

  /** Whether this page may acknowledge and shelve; the lease contains the current role. */
  get mayAct() {
    const lease = this.lease();
    return lease === null ? "mayAct" in this.strip.el.dataset : MAY_ACT.has(lease.role ?? "");
  }

  /** @param {readonly Pick<AlarmRow, "signal" | "raised">[]} rows */
  acknowledge(rows) {
    return this.act(this.actions.acknowledge(rows));
  }

  /**
   * @param {string[]} signals
   * @param {number} minutes
   */
  shelve(signals, minutes) {
    void this.act(this.actions.shelve(signals, minutes));
  }

  /** @param {Promise<import("./actions.js").ActionAnswer>} asked */
  async act(asked) {
    try {
      const { stored } = await asked;
      if (!stored) this.tell(t("Done, but not stored: a restart of URC would undo it."));
    } catch (error) {
      this.tell(`▲ ${reason(error)}`);
    }
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    const { book, store, mayAct } = this;
    this.strip.draw(book, store, nowMs, mayAct);
    this.sheet.draw(book, store, nowMs, mayAct);
    const { active, unacknowledged, worst } = book.count();
    const count = Math.max(active, unacknowledged);
    const title = count > 0 ? `${SIGNS[worst || "low"]} ${count} · ${this.title}` : this.title;
    if (document.title !== title) document.title = title;
  }

  /** The list for widgets. */
  news() {
    const { book, store } = this;
    const nowMs = performance.now();
    const alerts = [...book.listed(), ...book.hidden()].map((row) => alertOf(row, store, nowMs, book.leadMs));
    return { look: JSON.stringify(alerts), value: alerts };
  }
}

/**
 * @param {AlarmRow} row
 * @param {Store} store
 * @param {number} nowMs on the page's clock
 * @param {number} leadMs
 * @returns {Alert}
 */
export function alertOf(row, store, nowMs, leadMs) {
  const { text, unit, age } = store.reading(row.signal, nowMs);
  const beganMs = row.began - leadMs - Date.now() + nowMs;
  return {
    signal: row.signal,
    title: titleOf(row, store),
    alarm: levelOf(row),
    condition: stateWords(row.condition),
    text: row.known ? text : row.value,
    unit,
    age,
    since: Math.round(beganMs / 1000),
    priority: row.priority,
    state: row.state,
    isActive: row.active,
    isKnown: row.known,
    raised: row.raised,
    number: row.number,
    times: row.times,
    cause: row.cause,
    action: row.action,
    who: row.state === "shelved" ? row.shelved_by : row.acknowledged_by,
    leftS: row.shelved_until ? Math.max(0, Math.ceil((row.shelved_until - leadMs - Date.now()) / 1000)) : 0,
  };
}

function storage() {
  try {
    return localStorage;
  } catch {
    return null; // refused by the browser
  }
}
