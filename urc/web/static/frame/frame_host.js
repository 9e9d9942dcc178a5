// @ts-check
/**
 * The page's side of a third-party widget: its frame, and the frame's messages.
 *
 * The frame has no origin, so it cannot access the page. It has one port, whose messages
 * `frame_protocol.js` checks. It receives the readings and outputs of its cell, and may run the
 * bound commands. A frame is removed if it throws an exception, floods the page, navigates or stops
 * responding. Its cell then shows a card.
 *
 * @typedef {import("../widgets/cell.js").Doors} Doors
 * @typedef {import("../live/store.js").Store} Store
 * @typedef {import("./frame_protocol.js").Said} Said
 * @typedef {import("../core/types.js").Outlet} Outlet
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").Topics} Topics
 */
import { heard, MOST_COMMANDS, MOST_MESSAGES, Rate, tellable } from "./frame_protocol.js";
import { Cell } from "../widgets/cell.js";
import { give } from "../widgets/context.js";
import { t } from "../widgets/kit.js";
import { memoryOf } from "../widgets/tab_storage.js";
import { describe } from "../widgets/output.js";
import { TICK_MS, FrameWatchdog } from "./frame_watchdog.js";
import { filesOf } from "./frame_files.js";
import { Overlays } from "./frame_held_controls.js";

/** Time limit for the start of a frame. */
const COMING_MS = 20_000;
const LOADING_MS = 5000;
const PADS_EVERY_MS = 50;
/** Maximum number of STOP presses per second; more presses have no effect. */
const MOST_STOPS = 5;
/**
 * Maximum number of messages per second to the page itself. Browser extensions may send some;
 * widgets have a port.
 */
const MOST_ASIDE = 20;

/** Frame hosts whose frames may send messages to the page. @type {Set<FrameHost>} */
const wardens = new Set();
// The first of all listeners. It does not read the content, so a flood costs little time.
addEventListener("message", (event) => {
  for (const warden of wardens) {
    if (event.source !== warden.frameEl?.contentWindow) continue;
    event.stopImmediatePropagation();
    warden.aside();
    return;
  }
}, { capture: true });

const watch = new FrameWatchdog();
setInterval(() => {
  if (!document.hidden) watch.tick(performance.now());
}, TICK_MS);

export class FrameHost extends Cell {
  /**
   * @param {HTMLElement} el
   * @param {Doors} doors
   */
  constructor(el, doors) {
    super(el, doors);
    this.isForeign = true;
    /** Whether it pressed STOP itself, without an operator's touch since. */
    this.hasStopped = false;
    this.html = el.dataset["html"] ?? "";
    this.url = el.dataset["frame"] ?? "";
    /** @type {HTMLIFrameElement | null} */
    this.frameEl = null;
    /** @type {MessagePort | null} */
    this.port = null;
    /** Ends with this frame; the cell may get another frame. */
    this.life = new AbortController();
    this.overlays = new Overlays(this);
    this.memory = memoryOf(this.config.slot);
    /** Whether the frame has reported the start of work without its end. */
    this.isAtWork = false;
    this.strikes = 0;
    /** Whether the operator has moved the focus here. */
    this.isUsed = false;
    /** Whether the last update has not been drawn yet. */
    this.isFull = false;
    /** Edition of the store when the units were last sent. */
    this.toldEdition = -1;
    this.isUp = false;
    this.messages = new Rate(MOST_MESSAGES);
    this.asides = new Rate(MOST_ASIDE);
    this.commands = new Rate(MOST_COMMANDS);
    this.stops = new Rate(MOST_STOPS);
    /** @type {Set<string>} */
    this.followed = new Set();
    /** Files in its options. @type {Record<string, Blob>} */
    this.files = {};
    /** @type {() => void} */
    this.settled = () => {};
  }

  async mount() {
    const refused = this.el.dataset["error"];
    if (refused) {
      this.fail(new Error(refused));
      return;
    }
    const standing = new Promise((resolve) => {
      this.settled = () => resolve(undefined);
    });
    this.files = await filesOf(this.config.options, this.end.signal);
    this.enter();
    await standing;
  }

  /** Make a frame, and start the widget in it. */
  enter() {
    if (this.end.signal.aborted) return;
    this.life = new AbortController();
    const { signal } = this.life;
    const frame = document.createElement("iframe");
    frame.className = "urc-frame";
    frame.setAttribute("sandbox", "allow-scripts");
    frame.setAttribute("allow", "");
    frame.referrerPolicy = "no-referrer";
    frame.title = this.config.title;
    let loads = 0;
    frame.addEventListener("load", () => {
      loads += 1;
      if (loads === 1) this.meet(frame);
      else this.fail(new Error(t("it navigated to another page")));
    }, { signal });
    const late = setTimeout(() => {
      if (!this.isMounted) this.remark(t("◌ still loading"));
    }, LOADING_MS);
    const never = setTimeout(() => {
      if (!this.isUp) this.fail(new Error(t("its frame did not start")));
    }, COMING_MS);
    signal.addEventListener("abort", () => {
      clearTimeout(late);
      clearTimeout(never);
    });
    addEventListener("blur", () => setTimeout(() => this.keepFocus()), { signal });
    this.isUp = false;
    this.frameEl = frame;
    frame.src = this.url;
    this.el.prepend(frame);
    wardens.add(this);
    watch.add(this);
  }

  /** @param {HTMLIFrameElement} frame */
  meet(frame) {
    const { port1, port2 } = new MessageChannel();
    this.port = port1;
    port1.addEventListener("message", (event) => {
      // Counted before decoding, so that a flood costs little time.
      if (this.messages.take(performance.now())) this.take(event.data);
      else this.fail(new Error(t("it floods the page with messages")));
    }, { signal: this.life.signal });
    port1.start();
    // A frame without an origin cannot be addressed by name, but this message contains no secret.
    frame.contentWindow?.postMessage({ t: "port" }, "*", [port2]);
  }

  /** Count a message to the page that bypasses the port. */
  aside() {
    if (!this.asides.take(performance.now())) this.fail(new Error(t("it floods the page with messages")));
  }

  /** Take back the focus if the frame took it without the operator. */
  keepFocus() {
    if (document.activeElement !== this.frameEl) this.isUsed = false;
    else if (this.isTouched()) this.isUsed = true;
    else if (!this.isUsed) this.frameEl?.blur();
  }

  /** Whether the operator has just touched the frame. */
  isTouched() {
    return document.activeElement === this.frameEl && navigator.userActivation?.isActive !== false;
  }

  /** @param {object} message */
  post(message) {
    this.port?.postMessage(message);
  }

  /** @param {unknown} data */
  take(data) {
    const message = heard(data, this.config.outputs);
    if (message === null || this.life.signal.aborted) return;
    switch (message.t) {
      case "ready":
        if (!this.isUp) this.begin();
        break;
      case "mounted":
        this.isMounted = true;
        this.remark("");
        this.settled();
        this.doors.wake();
        break;
      case "failed":
        this.fail(new Error(message.message));
        break;
      case "alive":
        watch.answered(this);
        break;
      case "in":
      case "out":
        this.isAtWork = message.t === "in";
        break;
      case "more":
        this.isFull = false;
        this.doors.wake();
        break;
      case "slow":
        this.remark(message.isSlow ? t("◆ slow: updated once a second") : "");
        break;
      default:
        this.serve(message);
    }
  }

  /**
   * Perform a request of the widget.
   *
   * @param {Said} message
   */
  serve(message) {
    const { doors, life } = this;
    switch (message.t) {
      case "send":
        void this.give(message);
        break;
      case "steer":
        if (this.commands.take(performance.now())) {
          doors.steer(this.output(message.output)?.command ?? "", message.verb);
        }
        break;
      case "drive":
        if (this.isTouched()) doors.drive(message.wish);
        break;
      case "stop":
        this.stop();
        break;
      case "space":
        if (!message.isTaken || doors.input.isDriving()) this.stop();
        break;
      case "onstop":
        doors.stop.follow((state) => this.post({ t: "stopstate", state }), life.signal);
        break;
      case "follow":
        this.follow(message.what);
        break;
      case "look":
        if (this.inputs.some(({ input }) => input === message.input)) this.look(message.input, message.places);
        break;
      case "pads":
        this.showPads();
        break;
      case "memory":
        this.keep(message.text);
        break;
      default:
        this.overlays.take(message);
    }
  }

  /**
   * Press STOP. An operator's touch permits it at any time. The widget by itself may press STOP
   * only once, so that it cannot undo a reset.
   */
  stop() {
    // Browsers do not count Escape as a user activation, so the operator's focus counts instead.
    const isByHand = this.isTouched() || (this.isUsed && document.activeElement === this.frameEl);
    if (!isByHand && this.hasStopped) return;
    if (!this.stops.take(performance.now())) return;
    this.hasStopped = !isByHand;
    if (!isByHand) this.remark(t("■ this widget pressed STOP, not you"));
    this.doors.stop.press();
  }

  /** Send the widget to its frame, which is ready. */
  begin() {
    const { config, doors } = this;
    this.isUp = true;
    this.follow("theme");
    const commands = Object.entries(config.outputs).map(([name, bound]) => [name, describe(bound)]);
    this.toldEdition = doors.store.edition;
    this.post({
      t: "mount",
      title: config.title,
      widget: config.widget,
      html: this.html,
      module: this.el.dataset["module"] ?? `/widgets/${encodeURIComponent(config.widget)}/widget.js`,
      options: config.options,
      files: this.files,
      commands: Object.fromEntries(commands),
      units: this.unitsTold(),
      memory: this.memory.read(),
      originMs: performance.timeOrigin,
      theme: document.documentElement.dataset["theme"] ?? "",
    });
  }

  /** Return the displayed unit of each input. */
  unitsTold() {
    const { store } = this.doors;
    const pairs = this.inputs.map((bound) => {
      const { signal } = this.reading(bound, 0, store, 0);
      return [bound.input, store.units.shown(signal.unit ?? "")];
    });
    return Object.fromEntries(pairs);
  }

  /** @param {number} nowMs */
  isDue(nowMs) {
    return !this.isFull && super.isDue(nowMs);
  }

  /**
   * @param {number} _
   * @param {() => void} work
   */
  measured(_, work) {
    work(); // the frame measures its own time
  }

  /**
   * @param {Record<string, Reading>} readings
   * @param {string[]} changed
   * @param {Record<string, Outlet>} outlets
   * @param {boolean} isOutputNews
   */
  call(readings, changed, outlets, isOutputNews) {
    this.size = null; // the frame measures its own size
    if (changed.length === 0 && !isOutputNews) return;
    const { edition } = this.doors.store;
    const units = edition === this.toldEdition ? null : this.unitsTold();
    this.toldEdition = edition;
    const news = Object.fromEntries(changed.map((input) => [input, readings[input]]));
    this.isFull = true;
    this.post({ t: "frame", changed, readings: news, outlets: isOutputNews ? { ...outlets } : null, units });
  }

  /** @param {Extract<Said, {t: "send"}>} message */
  async give({ id, output, args }) {
    try {
      if (document.hidden) throw new Error(t("the page was hidden"));
      if (!this.commands.take(performance.now())) {
        throw new Error(t("too many commands: at most {most} per second", { most: MOST_COMMANDS }));
      }
      const values = await give(this, output, args);
      this.post({ t: "answer", id, values });
    } catch (error) {
      const { name, message } = error instanceof Error ? error : new Error(String(error));
      this.post({ t: "refused", id, name, message });
    }
  }

  /** @param {keyof Topics} what */
  follow(what) {
    if (this.followed.has(what)) return;
    this.followed.add(what);
    const signals = new Set(this.inputs.flatMap((bound) => bound.signals));
    const commands = new Set(this.outputs.map(([, { command }]) => command));
    const tell = (/** @type {unknown} */ news) => {
      this.post({ t: "topic", what, news: tellable(what, news, { signals, commands }) });
    };
    this.doors.follows.listen(what, tell, this.life.signal);
  }

  showPads() {
    let seen = "";
    const timer = setInterval(() => {
      const views = this.isVisible ? this.doors.input.pads.views() : [];
      const look = JSON.stringify(views);
      if (look !== seen) this.post({ t: "pads", views });
      seen = look;
    }, PADS_EVERY_MS);
    this.life.signal.addEventListener("abort", () => clearInterval(timer));
  }

  /** @param {string} text */
  keep(text) {
    try {
      this.memory.write(JSON.parse(text));
    } catch (error) {
      console.info(`widget ${this.config.widget}:`, error); // the frame received the error, too
    }
  }

  // -- called by the watchdog

  get isBusy() {
    return this.isAtWork || this.overlays.isOwed;
  }

  /** @param {number} n */
  ping(n) {
    this.keepFocus(); // no event reports a move from one frame to another
    this.post({ t: "ping", n });
  }

  accuse() {
    this.fail(new Error(t("it stopped answering")));
  }

  /** Remove the frame and release its held controls. */
  leave() {
    watch.remove(this);
    wardens.delete(this);
    this.life.abort();
    this.port?.close();
    this.port = null;
    this.frameEl?.remove();
    this.frameEl = null;
    this.isUp = false;
    this.isMounted = false;
    this.isAtWork = false;
    this.isFull = false;
    this.followed.clear();
    this.edition = -1; // a new frame gets all values
    this.seenOutlets = null;
    this.remark(t("◌ restarting: another widget blocked it"));
  }

  unmount() {
    super.unmount();
    this.leave();
    this.settled();
  }
}
