// @ts-check
/**
 * The life of the widgets: each in its cell, each on its own.
 *
 * The server has drawn the templates already. Here the module is loaded and mounted, and called in
 * animation frames when an input of it has changed. Whatever a widget throws costs its own cell,
 * which then shows a card; a cell that cannot be seen is sent nothing.
 *
 * @typedef {import("./types.js").Context} Context
 * @typedef {import("./types.js").HoldSpec} HoldSpec
 * @typedef {import("./types.js").Instance} Instance
 * @typedef {import("./types.js").Outlet} Outlet
 * @typedef {import("./types.js").Reading} Reading
 * @typedef {import("./types.js").StopState} StopState
 * @typedef {import("./types.js").Value} Value
 * @typedef {import("./types.js").WidgetModule} WidgetModule
 * @typedef {import("./output.js").Output} Output
 * @typedef {import("./store.js").Store} Store
 *
 * @typedef {object} Config
 * @property {string} slot
 * @property {string} widget
 * @property {string} title
 * @property {Record<string, string>} inputs
 * @property {Record<string, Output>} outputs
 * @property {Record<string, unknown>} options
 *
 * @typedef {(command: string, args: Record<string, Value>) => Promise<Record<string, Value>>} Run
 */
import { argumentsOf } from "./output.js";

/**
 * @typedef {object} Doors Where what widgets do goes.
 * @property {Run} run
 * @property {() => void} wake asks for an animation frame
 * @property {import("./input.js").Input} input
 * @property {import("./stop.js").StopButton} stop
 */

class Cell {
  /**
   * @param {HTMLElement} el
   * @param {Doors} doors
   */
  constructor(el, doors) {
    this.el = el;
    this.doors = doors;
    /** @type {Config} */
    this.config = JSON.parse(el.dataset["config"] ?? "{}");
    this.inputs = Object.entries(this.config.inputs);
    this.outputs = Object.entries(this.config.outputs);
    this.end = new AbortController();
    /** @type {Instance} */
    this.instance = {};
    this.isMounted = false;
    this.isVisible = true;
    /** @type {Map<string, ((reading: Reading) => void)[]>} */
    this.listeners = new Map();
    /** What each input and output was like when the widget last saw it. @type {Map<string, string>} */
    this.seen = new Map();
    /** @type {{width: number, height: number} | null} */
    this.size = null;
  }

  async mount() {
    const refused = this.el.dataset["error"];
    if (refused) {
      this.fail(new Error(refused));
      return;
    }
    try {
      const url = `/widgets/${encodeURIComponent(this.config.widget)}/widget.js`;
      /** @type {WidgetModule} */
      const module = await import(url);
      const instance = await module.default.mount(this.context());
      if (this.end.signal.aborted) return;
      this.instance = instance ?? {};
      this.isMounted = true;
      this.doors.wake();
    } catch (error) {
      this.fail(error);
    }
  }

  /** @returns {Context} */
  context() {
    return Object.freeze({
      el: this.el,
      options: Object.freeze(this.config.options),
      signal: this.end.signal,
      on: (/** @type {string} */ input, /** @type {(reading: Reading) => void} */ listener) => {
        this.listeners.set(input, [...(this.listeners.get(input) ?? []), listener]);
      },
      send: (/** @type {string} */ output, /** @type {Record<string, Value>} */ args = {}) => {
        const bound = Object.hasOwn(this.config.outputs, output)
          ? this.config.outputs[output]
          : undefined;
        if (bound === undefined) {
          return Promise.reject(new Error(`the output ${output} is not bound to a command`));
        }
        return this.doors.run(bound.command, argumentsOf(bound, args));
      },
      hold: (/** @type {string} */ output, /** @type {HoldSpec} */ spec) => {
        const bound = Object.hasOwn(this.config.outputs, output)
          ? this.config.outputs[output]
          : undefined;
        if (bound === undefined) throw new Error(`the output ${output} is not bound to a command`);
        this.doors.input.hold(bound, spec, this.end.signal);
      },
      stop: () => this.doors.stop.press(),
      onStop: (/** @type {(state: StopState) => void} */ listener) => {
        this.doors.stop.follow(listener, this.end.signal);
      },
    });
  }

  /**
   * Give the widget what has changed. Called in an animation frame.
   *
   * @param {Store} store
   * @param {number} nowMs
   */
  frame(store, nowMs) {
    if (!this.isMounted || !this.isVisible) return;
    /** @type {Record<string, Reading>} */
    const readings = Object.create(null);
    /** @type {string[]} */
    const changed = [];
    const outlets = this.outlets(store);
    const outlook = JSON.stringify(outlets);
    const isOutputNews = this.seen.get("") !== outlook; // no input has this name
    this.seen.set("", outlook);
    for (const [input, signal] of this.inputs) {
      const reading = store.reading(signal, nowMs);
      const look = `${reading.serial} ${reading.state} ${reading.age} ${store.edition}`;
      readings[input] = reading;
      if (this.seen.get(input) !== look) {
        this.seen.set(input, look);
        changed.push(input);
      }
    }
    try {
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
    } catch (error) {
      this.fail(error);
    }
  }

  /**
   * @param {Store} store
   * @returns {Record<string, Outlet>}
   */
  outlets(store) {
    /** @type {Record<string, Outlet>} */
    const found = Object.create(null);
    for (const [name, { line, refusal, isAnswered, isHeld }] of this.outputs) {
      const shared = refusal || store.hindrance(line, isHeld);
      const reason = shared || (isHeld ? this.doors.input.refusal() : "");
      found[name] = { isReady: reason === "", reason, isAnswered };
    }
    return found;
  }

  /**
   * Replace the widget by a card that says what happened.
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
    title.textContent = `◆ ${this.config.title}: this widget does not work`;
    const reason = document.createElement("p");
    reason.textContent = error instanceof Error ? error.message : String(error);
    card.append(title, reason);
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

export class Host {
  /**
   * @param {Store} store
   * @param {Doors} doors
   */
  constructor(store, doors) {
    this.store = store;
    this.doors = doors;
    /** @type {Map<Element, Cell>} */
    this.cells = new Map();
    this.sight = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const cell = this.cells.get(entry.target);
        if (cell) cell.isVisible = entry.isIntersecting;
      }
      this.doors.wake();
    });
    this.sizes = new ResizeObserver((entries) => {
      for (const entry of entries) {
        const cell = this.cells.get(entry.target);
        if (cell) cell.size = { width: entry.contentRect.width, height: entry.contentRect.height };
      }
      this.doors.wake();
    });
  }

  /** @param {ParentNode} root */
  mountAll(root) {
    for (const el of root.querySelectorAll("[data-config]")) {
      if (!(el instanceof HTMLElement)) continue;
      const cell = new Cell(el, this.doors);
      this.cells.set(el, cell);
      this.sight.observe(el);
      this.sizes.observe(el);
      void cell.mount();
    }
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    for (const cell of this.cells.values()) cell.frame(this.store, nowMs);
  }
}
