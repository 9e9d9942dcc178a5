// @ts-check
/**
 * The code inside the frame of a third-party widget. It communicates with the page through one
 * port.
 *
 * The widget's code shares this document, so the page does not trust any message from the frame.
 * This code provides widgets with the same interface as in the page.
 *
 * @typedef {import("../core/types.js").Instance} Instance
 * @typedef {import("../core/types.js").Outlet} Outlet
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").WidgetModule} WidgetModule
 */
import { RenderBudget } from "../widgets/render_budget.js";
import { contextOf } from "./context.js";
import { FrameHeldControls } from "./grips.js";
import { part, t } from "../widgets/kit.js";

/** Base URL of the frame's code. Frames send no cookies, so the path contains a secret. */
const PLACE = new URL("../..", import.meta.url);

/** @param {string} url URL of a module in our pages */
function below(url) {
  return new URL(url.replace(/^\//, ""), PLACE).href;
}

/** Interval between updates of a slow widget. */
const SLOW_EVERY_MS = 1000;

/** Policy for the server's markup; a second policy cannot be created. */
const markup = /** @type {any} */ (globalThis).trustedTypes?.createPolicy("urc", {
  createHTML: (/** @type {string} */ html) => html,
});

export class Frame {
  /** @param {MessagePort} port */
  constructor(port) {
    // Bound now, because the widget may change the prototype later.
    this.say = port.postMessage.bind(port);
    this.el = part(document, "[data-frame]");
    this.end = new AbortController();
    this.budget = new RenderBudget();
    this.grips = new FrameHeldControls(this);
    this.widget = "";
    /** @type {Instance} */
    this.instance = {};
    this.isMounted = false;
    /** @type {Map<string, ((reading: any) => void)[]>} */
    this.listeners = new Map();
    /** @type {Record<string, any>} */
    this.readings = {};
    /** @type {Record<string, Outlet>} */
    this.outlets = {};
    /** @type {Record<string, import("../core/types.js").Described | null>} */
    this.commands = {};
    /** @type {Record<string, import("../core/types.js").Conversion>} */
    this.units = {};
    /** @type {unknown} */
    this.memory = null;
    /** Offset from the page's clock to this frame's. */
    this.shiftS = 0;
    /** @type {Map<number, {resolve: (values: any) => void, reject: (error: Error) => void}>} */
    this.waiting = new Map();
    /** @type {Map<string, {news: unknown, isKnown: boolean, listeners: ((news: any) => void)[]}>} */
    this.topics = new Map();
    /** @type {import("../core/types.js").PadView[]} */
    this.pads = [];
    port.addEventListener("message", ({ data }) => this.take(data));
    port.start();
    this.watchKeys();
    this.say({ t: "ready" });
  }

  /** Forward the keys of STOP to the page. */
  watchKeys() {
    addEventListener("keydown", (event) => {
      if (event.code === "Escape" && !event.repeat) this.say({ t: "stop" });
      if (event.code !== "Space" || event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
      const target = event.target instanceof Element ? event.target : null;
      const isTaken = Boolean(target?.closest("button, a, input, select, textarea, summary, [role]"));
      this.say({ t: "space", isTaken });
    }, { capture: true });
  }

  /** @param {any} message */
  take(message) {
    switch (message.t) {
      case "ping":
        this.say({ t: "alive", n: message.n });
        break;
      case "mount":
        void this.mount(message);
        break;
      case "frame":
        this.draw(message);
        break;
      case "answer":
      case "refused":
        this.settle(message);
        break;
      case "topic":
        this.tell(message.what, message.news);
        break;
      case "stopstate":
        this.tell("stop", message.state);
        break;
      case "pads":
        this.pads = message.views;
        break;
      default:
        this.grips.take(message);
    }
  }

  /** @param {any} message */
  async mount({ title, widget, html, module: url, options, files, commands, units, memory, originMs, theme }) {
    this.widget = widget;
    this.commands = commands;
    this.units = units;
    this.memory = memory;
    this.shiftS = (originMs - performance.timeOrigin) / 1000;
    document.title = title;
    showTheme(theme);
    this.follow("theme", ({ name }) => showTheme(name), true);
    this.el.innerHTML = markup ? markup.createHTML(html) : html;
    try {
      /** @type {WidgetModule} */
      const module = await import(below(url));
      this.say({ t: "in" });
      const mounting = module.default.mount(contextOf(this, opened(options, files)));
      this.say({ t: "out" });
      this.instance = (await mounting) ?? {};
      this.isMounted = true;
      this.watchSize();
      this.say({ t: "mounted" });
    } catch (error) {
      this.fail(error);
    }
  }

  watchSize() {
    new ResizeObserver(([entry]) => {
      if (!entry) return;
      const { width, height } = entry.contentRect;
      this.guarded(() => this.instance.resize?.({ width, height }))(undefined);
      this.grips.place();
    }).observe(this.el);
    addEventListener("pagehide", () => {
      this.end.abort();
      this.instance.destroy?.();
    });
  }

  /** @param {unknown} error */
  fail(error) {
    this.end.abort();
    console.warn(`widget ${this.widget}:`, error);
    this.say({ t: "failed", message: error instanceof Error ? error.message : String(error) });
  }

  /**
   * Report an exception of a listener to the page.
   *
   * @template T
   * @param {(news: T) => void} listener
   * @returns {(news: T) => void}
   */
  guarded(listener) {
    return (news) => {
      if (this.end.signal.aborted) return;
      this.say({ t: "in" });
      try {
        listener(news);
      } catch (error) {
        this.fail(error);
      }
      this.say({ t: "out" });
    };
  }

  /** @param {{changed: string[], readings: Record<string, any>, outlets: Record<string, Outlet> | null, units: any}} news */
  draw({ changed, readings, outlets, units }) {
    const nowMs = performance.now();
    if (units) this.units = units;
    if (outlets) this.outlets = outlets;
    for (const [input, reading] of Object.entries(readings)) {
      for (const one of [reading].flat()) one.time += this.shiftS;
      this.readings[input] = reading;
    }
    const wasSlow = this.budget.isSlow;
    this.guarded(() => {
      for (const input of changed) {
        this.listeners.get(input)?.forEach((listener) => listener(this.readings[input]));
      }
      this.instance.update?.(this.readings, this.outlets);
    })(undefined);
    this.budget.count(nowMs, performance.now() - nowMs);
    const { isSlow } = this.budget;
    if (this.budget.isSpent) this.fail(new Error(t("it blocks the page repeatedly")));
    else if (isSlow !== wasSlow) this.say({ t: "slow", isSlow });
    if (isSlow) setTimeout(() => this.say({ t: "more" }), SLOW_EVERY_MS);
    else this.say({ t: "more" });
    this.grips.place();
  }

  /** @param {{t: string, id: number, values?: any, name?: string, message?: string}} message */
  settle({ t: kind, id, values, name = "Error", message = "" }) {
    const asked = this.waiting.get(id);
    this.waiting.delete(id);
    if (kind === "answer") {
      asked?.resolve(values);
    } else {
      const error = new Error(message);
      error.name = name;
      asked?.reject(error);
    }
  }

  /**
   * @param {string} what
   * @param {(news: any) => void} listener
   * @param {boolean} isTold whether the page sends it without a request
   */
  follow(what, listener, isTold = false) {
    const topic = this.topics.get(what) ?? { news: null, isKnown: false, listeners: [] };
    topic.listeners.push(listener);
    if (topic.isKnown) queueMicrotask(() => this.guarded(listener)(topic.news));
    if (this.topics.has(what)) return;
    this.topics.set(what, topic);
    if (isTold) return;
    this.say(what === "stop" ? { t: "onstop" } : { t: "follow", what });
  }

  /**
   * @param {string} what
   * @param {unknown} news
   */
  tell(what, news) {
    const topic = this.topics.get(what);
    if (!topic) return;
    topic.news = news;
    topic.isKnown = true;
    for (const listener of topic.listeners) this.guarded(listener)(news);
  }
}

/** @param {string} name */
function showTheme(name) {
  if (name) document.documentElement.dataset["theme"] = name;
  else delete document.documentElement.dataset["theme"];
}

/**
 * Replace file URLs by the URLs of the blobs from the page.
 *
 * @param {Record<string, unknown>} options
 * @param {Record<string, Blob>} files
 */
function opened(options, files) {
  const urls = new Map(Object.entries(files).map(([url, file]) => [url, URL.createObjectURL(file)]));
  const one = (/** @type {unknown} */ value) => urls.get(String(value)) ?? value;
  const pairs = Object.entries(options).map(([name, value]) => {
    return [name, Array.isArray(value) ? value.map(one) : typeof value === "string" ? one(value) : value];
  });
  return Object.freeze(Object.fromEntries(pairs));
}

const meeting = new AbortController();
addEventListener("message", (event) => {
  const [port] = event.ports;
  if (event.source !== parent || !port) return;
  meeting.abort();
  new Frame(port);
}, { signal: meeting.signal });
