// @ts-check
/**
 * One widget in its cell: its context, its frames, and its failures.
 *
 * A widget that throws an exception or needs too much of the page's time only loses its own cell,
 * which then shows a card. Hidden cells get no data.
 *
 * @typedef {import("../core/types.js").Conversion} Conversion
 * @typedef {import("../core/types.js").Instance} Instance
 * @typedef {import("../core/types.js").Outlet} Outlet
 * @typedef {import("../core/types.js").PadDesk} PadDesk
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").Given} Given
 * @typedef {import("../core/types.js").Value} Value
 * @typedef {import("../core/types.js").WidgetModule} WidgetModule
 * @typedef {import("./output.js").Output} Output
 * @typedef {import("../live/store.js").Store} Store
 *
 * @typedef {object} Config
 * @property {string} slot
 * @property {string} widget
 * @property {string} title
 * @property {Record<string, string | string[]>} inputs Input → its signal, or its signals.
 * @property {Record<string, (Conversion | null)[]>} conversions Input → conversion of each of its
 *   signals to the unit of the input; omitted if no conversion is needed.
 * @property {Record<string, Output>} outputs
 * @property {Record<string, unknown>} options
 * @property {boolean} [deadMan] Whether it is a dead-man control.
 *
 * @typedef {(command: string, args: Record<string, Given>, ticket?: import("../control/confirm_dialog.js").Ticket) => Promise<Record<string, Value>>} Run
 *
 * @typedef {object} Doors Services of the page for widgets.
 * @property {Run} run
 * @property {import("../control/confirm_dialog.js").ConfirmDialog} asks
 * @property {(command: string, verb: string) => void} steer
 * @property {(wish: import("../core/types.js").PendingValue) => void} drive
 * @property {() => void} wake requests an animation frame
 * @property {() => void} again requests an animation frame only for widgets
 * @property {Pick<import("../control/input.js").Input, "hold" | "gate" | "gated" | "letGo" | "refusal" | "stopReason" | "hindrance" | "lacks" | "isDriving" | "images"> & {pads: PadDesk}} input
 * @property {Pick<import("../control/stop.js").StopButton, "press" | "follow">} stop
 * @property {Pick<import("../live/page_topics.js").PageTopics, "listen">} follows
 * @property {import("../alarms/demo_alarms.js").AlarmDoor} alarms
 * @property {Store} store
 */
import { RenderBudget } from "./render_budget.js";
import { contextOf } from "./context.js";
import { ageText } from "../core/formatting.js";
import { attribute, t } from "./kit.js";
import { PICTURES } from "../live/store.js";

/** Time limit for loading; after the limit, the cell shows a note. */
const LOADING_MS = 5000;

/** @type {readonly string[]} */
const NONE = Object.freeze([]);
/** Outputs of a widget without outputs. @type {Record<string, Outlet>} */
const NO_OUTLETS = Object.freeze(Object.create(null));

/**
 * Signals of one input, with their state at the widget's last call.
 *
 * @typedef {{input: string, signals: string[], isMany: boolean, seen: (number | string)[], alarms: string}} Bound
 */

export class Cell {
  /**
   * @param {HTMLElement} el
   * @param {Doors} doors
   */
  constructor(el, doors) {
    this.el = el;
    this.doors = doors;
    /** @type {Config} */
    this.config = JSON.parse(el.dataset["config"] ?? "{}");
    /** @type {Bound[]} */
    this.inputs = Object.entries(this.config.inputs).map(([input, bound]) => {
      const isMany = Array.isArray(bound);
      return { input, isMany, signals: isMany ? bound : [bound], seen: [], alarms: "" };
    });
    this.outputs = Object.entries(this.config.outputs);
    this.end = new AbortController();
    /** @type {Instance} */
    this.instance = {};
    this.isMounted = false;
    this.isVisible = true;
    this.budget = new RenderBudget();
    /** @type {Map<string, ((reading: Reading) => void)[]>} */
    this.listeners = new Map();
    /**
     * State of the outputs at the widget's last call; null before the first call.
     *
     * @type {string | null}
     */
    this.seenOutlets = null;
    /** Edition of the store at the last complete drawing. */
    this.edition = -1;
    /** Whether it is a third-party widget. */
    this.isForeign = false;
    /** Its image inputs. @type {{edition: number, names: readonly string[]}} */
    this.images = { edition: -1, names: NONE };
    /**
     * Indexes of the visible images, by input; without an entry, all images are visible.
     *
     * @type {Map<string, ReadonlySet<number>>}
     */
    this.looks = new Map();
    /** Cached units of the context. @type {Map<string, {edition: number, symbol: string, factor: (value: number) => number}>} */
    this.shownIn = new Map();
    /** @type {{width: number, height: number} | null} */
    this.size = null;
    /** Note over the widget: loading, or slow. @type {HTMLElement | null} */
    this.note = null;
    /** Note about the topics of its signals; "" without a note. */
    this.topicNote = "";
  }

  async mount() {
    const refused = this.el.dataset["error"];
    if (refused) {
      this.fail(new Error(refused));
      return;
    }
    const late = setTimeout(() => this.remark(t("◌ still loading")), LOADING_MS);
    try {
      const url = this.el.dataset["module"] ?? `/widgets/${encodeURIComponent(this.config.widget)}/widget.js`;
      /** @type {WidgetModule} */
      const module = await import(url);
      const instance = await module.default.mount(contextOf(this));
      if (this.end.signal.aborted) return;
      this.instance = instance ?? {};
      this.isMounted = true;
      this.remark("");
      this.doors.wake();
    } catch (error) {
      this.fail(error);
    } finally {
      clearTimeout(late);
    }
  }

  /** @param {string} name */
  output(name) {
    return Object.hasOwn(this.config.outputs, name) ? this.config.outputs[name] : undefined;
  }

  /**
   * @param {string} input
   * @param {(reading: Reading) => void} listener
   */
  listen(input, listener) {
    this.listeners.set(input, [...(this.listeners.get(input) ?? []), listener]);
  }

  /**
   * Return the listener in a wrapper that limits its exceptions to this cell.
   *
   * @template T
   * @param {(news: T) => void} listener
   * @returns {(news: T) => void}
   */
  guarded(listener) {
    return (news) => {
      if (this.end.signal.aborted) return;
      try {
        listener(news);
      } catch (error) {
        this.fail(error);
      }
    };
  }

  /**
   * @param {Bound} bound
   * @param {number} place index of the signal
   * @param {Store} store
   * @param {number} nowMs
   */
  reading({ input, signals }, place, store, nowMs) {
    const conversions = this.config.conversions ?? {};
    const conversion = Object.hasOwn(conversions, input) ? conversions[input]?.[place] : undefined;
    return store.reading(signals[place] ?? "", nowMs, conversion ?? undefined);
  }

  /** Return whether the widget may be called now. @param {number} nowMs */
  isDue(nowMs) {
    return this.isMounted && this.isVisible && this.budget.allows(nowMs);
  }

  /**
   * Select the visible images of an input; the server sends no others.
   *
   * @param {string} input
   * @param {readonly number[]} places
   */
  look(input, places) {
    this.looks.set(input, new Set(places));
    this.images.edition = -1;
    this.doors.wake();
  }

  /** Return the names of the visible images. @param {Store} store */
  pictures(store) {
    if (!this.isMounted || !this.isVisible) return NONE;
    if (this.images.edition !== store.edition) {
      const found = this.visibleSignals().filter((name) => PICTURES.has(store.signals.get(name)?.type ?? ""));
      this.images = { edition: store.edition, names: found };
    }
    return this.images.names;
  }

  /** Whether a signal is one of the widget's inputs. @param {string} name */
  shows(name) {
    return this.inputs.some(({ signals }) => signals.includes(name));
  }

  /**
   * Return the urgency of a call: 0 for no change, 1 for new values, and 2 for a change that must
   * not wait (a size, an output, a value that is no longer live, the start or end of an alarm).
   *
   * @param {Store} store
   * @param {number} nowMs
   * @returns {0 | 1 | 2}
   */
  news(store, nowMs) {
    if (!this.isDue(nowMs)) return 0;
    if (this.size || this.edition !== store.edition) return 2;
    if (this.outputs.length > 0 ? this.outlook(store) !== this.seenOutlets : this.seenOutlets === null) return 2;
    /** @type {0 | 1 | 2} */
    let found = 0;
    for (const { signals, seen, alarms } of this.inputs) {
      for (let place = 0; place < signals.length; place += 1) {
        const name = signals[place] ?? "";
        const look = store.look(name, nowMs);
        if (look === seen[place]) continue;
        if (typeof look === "string" || typeof seen[place] === "string") return 2;
        found = 1;
      }
      if (found && alarms !== alarmsOf(signals, store)) return 2;
    }
    return found;
  }

  /** @param {Store} store */
  outlook(store) {
    return JSON.stringify(this.outlets(store));
  }

  /**
   * Pass changes to the widget, if any. Called in an animation frame.
   *
   * @param {Store} store
   * @param {number} nowMs
   */
  frame(store, nowMs) {
    if (this.news(store, nowMs)) this.show(store, nowMs);
  }

  /**
   * Pass the changes since the last call to the widget.
   *
   * @param {Store} store
   * @param {number} nowMs
   */
  show(store, nowMs) {
    /** An input of many signals has a list. @type {Record<string, any>} */
    const readings = Object.create(null);
    /** @type {string[]} */
    const changed = [];
    const isAllNew = this.edition !== store.edition;
    const outlets = this.outputs.length > 0 ? this.outlets(store) : NO_OUTLETS;
    const outlook = this.outputs.length > 0 ? JSON.stringify(outlets) : "";
    const isOutputNews = this.seenOutlets !== outlook;
    this.edition = store.edition;
    this.seenOutlets = outlook;
    if (isOutputNews) this.markStopped(outlets);
    this.tellTopics(store, nowMs);
    for (const bound of this.inputs) {
      const { input, signals, seen } = bound;
      const each = signals.map((_, place) => this.reading(bound, place, store, nowMs));
      const looks = signals.map((name) => store.look(name, nowMs));
      readings[input] = bound.isMany ? each : each[0];
      if (isAllNew || looks.some((look, place) => look !== seen[place])) changed.push(input);
      bound.seen = looks;
      bound.alarms = alarmsOf(signals, store);
    }
    this.markOld(store, nowMs);
    this.measured(nowMs, () => this.call(readings, changed, outlets, isOutputNews));
  }

  /**
   * Mark a widget that shows only values of lost links, with their age: a hatched cell is not live.
   *
   * @param {Store} store
   * @param {number} nowMs
   */
  markOld(store, nowMs) {
    const ageMs = lastAgeMs(this.visibleSignals(), store, nowMs);
    const age = ageMs < 0 ? null : ageText(ageMs / 1000);
    attribute(this.el, "data-old", age && t("{age} old", { age }));
    attribute(this.el, "data-old-age", age);
  }

  /** Return the signals of the inputs, without the images that the widget does not show. */
  visibleSignals() {
    return this.inputs.flatMap(({ input, signals }) => {
      const places = this.looks.get(input);
      return places ? signals.filter((_, place) => places.has(place)) : signals;
    });
  }

  /**
   * Mark a widget that waits for the reset of STOP: the bar names the reason once for all of them.
   *
   * @param {Record<string, Outlet>} outlets
   */
  markStopped(outlets) {
    const stop = this.doors.input.stopReason();
    const waits = stop !== "" && Object.values(outlets).some(({ reason }) => reason === stop);
    this.el.toggleAttribute("data-stopped", waits);
  }

  /**
   * Tell why the widget's signals have no value, if the robot's topics show the reason.
   *
   * @param {Store} store
   * @param {number} nowMs
   */
  tellTopics(store, nowMs) {
    const note = store.topicNote(this.inputs.flatMap(({ signals }) => signals), nowMs);
    if (note === this.topicNote) return;
    this.topicNote = note;
    this.remark(note ? `◆ ${note}` : "");
  }

  /**
   * @param {Record<string, Reading>} readings
   * @param {string[]} changed
   * @param {Record<string, Outlet>} outlets
   * @param {boolean} isOutputNews
   */
  call(readings, changed, outlets, isOutputNews) {
    if (this.size) {
      this.instance.resize?.(this.size);
      this.size = null;
    }
    if (changed.length === 0 && !isOutputNews) return;
    for (const input of changed) {
      const reading = readings[input];
      if (reading) this.listeners.get(input)?.forEach((listener) => listener(reading));
    }
    this.instance.update?.(readings, outlets);
  }

  /**
   * Call the widget, and measure the time of the call.
   *
   * @param {number} nowMs
   * @param {() => void} work
   */
  measured(nowMs, work) {
    const startMs = performance.now();
    try {
      work();
    } catch (error) {
      this.fail(error);
      return;
    }
    const wasSlow = this.budget.isSlow;
    this.budget.count(nowMs, performance.now() - startMs);
    if (this.budget.isSpent) this.fail(new Error(t("it blocks the page repeatedly")));
    else if (this.budget.isSlow !== wasSlow) {
      const usual = this.topicNote ? `◆ ${this.topicNote}` : "";
      this.remark(this.budget.isSlow ? t("◆ slow: updated once a second") : usual);
    }
  }

  /**
   * @param {Store} store
   * @returns {Record<string, Outlet>}
   */
  outlets(store) {
    /** @type {Record<string, Outlet>} */
    const found = Object.create(null);
    const { input } = this.doors;
    for (const [name, { command, line, refusal, isAnswered, isHeld, moves, role }] of this.outputs) {
      const shared = refusal || store.hindrance(line, isHeld);
      const own = isHeld ? input.refusal() : input.hindrance(moves);
      const reason = shared || own || input.lacks(role);
      const notice = reason === "" ? (store.topics.commands.get(command) ?? "") : "";
      found[name] = { isReady: reason === "", reason, isAnswered, notice };
    }
    return found;
  }

  /**
   * Show a note over the widget; "" removes it.
   *
   * @param {string} text
   */
  remark(text) {
    this.note?.remove();
    this.note = null;
    if (!text || this.end.signal.aborted) return;
    this.note = document.createElement("p");
    this.note.className = "urc-remark";
    this.note.setAttribute("role", "status");
    this.note.textContent = text;
    this.el.append(this.note);
  }

  /**
   * Replace the widget by a card with the reason.
   *
   * @param {unknown} error
   */
  fail(error) {
    console.warn(`widget ${this.config.widget} in slot ${this.config.slot}:`, error);
    this.unmount();
    const card = document.createElement("div");
    card.className = "urc-fault";
    card.setAttribute("role", "group");
    const title = document.createElement("strong");
    title.textContent = t("◆ {title}: this widget does not work", { title: this.config.title });
    const reason = document.createElement("p");
    reason.textContent = error instanceof Error ? error.message : String(error);
    const hint = document.createElement("p");
    hint.textContent = t("Other widgets still work. Reload the page to retry this one.");
    card.append(title, reason, hint);
    this.el.replaceChildren(card);
  }

  unmount() {
    const { destroy } = this.instance;
    this.isMounted = false;
    this.instance = {};
    this.end.abort();
    try {
      destroy?.();
    } catch (error) {
      console.warn(`widget ${this.config.widget}: destroy failed:`, error);
    }
  }
}

/**
 * Return the age of the oldest image, or else of the newest value, if all links of the signals are
 * lost; -1 if a signal is live, or if nothing is shown.
 *
 * @param {readonly string[]} signals
 * @param {Store} store
 * @param {number} nowMs
 */
function lastAgeMs(signals, store, nowMs) {
  const images = signals.filter((name) => store.samples.get(name)?.image ?? store.samples.get(name)?.video);
  const ages = [];
  for (const name of images.length > 0 ? images : signals) {
    const ageMs = store.lastAgeMs(name, nowMs);
    if (ageMs >= 0) ages.push(ageMs);
    else if (store.state(name, nowMs) === "live") return -1;
  }
  if (ages.length === 0) return -1;
  return images.length > 0 ? Math.max(...ages) : Math.min(...ages);
}

/**
 * @param {readonly string[]} signals
 * @param {Store} store
 */
function alarmsOf(signals, store) {
  if (signals.length === 1) return store.samples.get(signals[0] ?? "")?.alarm ?? "";
  return signals.map((name) => store.samples.get(name)?.alarm ?? "").join();
}
