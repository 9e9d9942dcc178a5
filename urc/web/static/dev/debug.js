// @ts-check
/**
 * The debug interface of every robot: all signals with their ages, a form for each command, and the
 * traffic log if available.
 *
 * @typedef {import("./debug_commands.js").Doors} CommandDoors
 * @typedef {import("../live/store.js").Store} Store
 * @typedef {CommandDoors & {store: Store}} Doors
 */
import { part } from "../live/badge.js";
import { DebugCommands } from "./debug_commands.js";
import { DebugSignals } from "./debug_signals.js";
import { WireLog } from "./log.js";
import { Socket } from "../live/socket.js";

export class Debug {
  /**
   * @param {HTMLElement} el
   * @param {Doors} doors
   */
  constructor(el, doors) {
    this.over = new AbortController();
    this.signals = new DebugSignals(el, doors.store, this.over.signal);
    new DebugCommands(part(el, "[data-commands]"), part(el, "[data-find-command]"), doors, this.over.signal);
    const wire = el.dataset["wire"];
    if (wire) watchWire(el, wire, this.over.signal);
  }

  /** Return the names of the visible images. */
  pictures() {
    return this.signals.pictures();
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    this.signals.frame(nowMs);
  }

  end() {
    this.over.abort();
  }
}

/**
 * @param {HTMLElement} el
 * @param {string} path
 * @param {AbortSignal} over
 */
function watchWire(el, path, over) {
  const log = new WireLog(el);
  const address = new URL(path, location.href);
  address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
  const line = new Socket(address.href, {
    message(/** @type {any} */ message) {
      if (message.t === "hello") log.restart();
      else if (message.t === "rows") log.add(message);
      else if (message.t === "profile") log.setLines(message.lines);
    },
    trip() {},
    state() {},
  });
  line.open();
  over.addEventListener("abort", () => line.close());
  addEventListener("pagehide", () => line.close(), { signal: over });
  addEventListener("pageshow", (event) => event.persisted && line.open(), { signal: over });
}
