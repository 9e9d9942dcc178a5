// @ts-check
/**
 * The main area of the page: the cells of an interface with its tabs, or the debug interface. It can
 * switch interfaces without a reload.
 *
 * @typedef {import("../dev/debug.js").Debug} Debug
 * @typedef {import("../dev/debug.js").Doors} DebugDoors
 *
 * @typedef {object} More
 * @property {import("../widgets/host.js").Host} host
 * @property {Pick<import("../control/input.js").Input, "letGo" | "letGoIn" | "owns">} input
 * @property {() => void} wake
 * @property {import("../alarms/book.js").AlarmBook} book
 */
import { part } from "./badge.js";
import { watchDrawer } from "./drawer.js";
import { keepFloatsFree } from "./floats.js";
import { keepBarTools } from "./bar_tools.js";
import { nextView, swapViews } from "./ground.js";
import { Interfaces } from "./interfaces.js";
import { RestPage } from "./rest_page.js";
import { tabsOf } from "./tabs.js";
import { said, t } from "../core/words.js";

export class ViewSwitch {
  /**
   * @param {HTMLElement} root
   * @param {DebugDoors & More} doors
   */
  constructor(root, doors) {
    this.doors = doors;
    this.root = root;
    this.el = part(root, "[data-stage]");
    /** @type {Debug | null} */
    this.debug = null;
    /** @type {RestPage | null} */
    this.rest = null;
    /** Ends with the current interface. */
    this.ends = new AbortController();
    this.enter();
    new Interfaces(root, {
      letGo: (reason) => doors.input.letGo(reason),
      leave: () => this.leave(),
      enter: () => this.enter(),
    });
    // On the window, so that controls that use the key themselves take precedence.
    addEventListener("keydown", (event) => {
      if (event.code !== "KeyV" || event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
      if (!event.defaultPrevented && doors.input.owns(event.target)) nextView(this.el);
    });
    addEventListener("urc-let-go", (event) => {
      if (event instanceof CustomEvent) doors.input.letGo(said(String(event.detail)));
    });
  }

  /** Return the names of visible images outside widgets. */
  pictures() {
    return this.debug?.pictures() ?? [];
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    this.debug?.frame(nowMs);
    this.rest?.mark(this.doors.book);
  }

  /** Start the current interface. */
  enter() {
    const { host, input, wake } = this.doors;
    swapViews(this.el);
    this.ends = new AbortController();
    keepBarTools(part(this.root, "[data-bar-place]"), part(this.root, "[data-menu-place]"), this.el, this.ends.signal);
    host.mountAll(this.el);
    keepFloatsFree(this.el, this.ends.signal);
    const letGo = () => input.letGo(t("another page was opened"));
    tabsOf(this.el, letGo);
    this.rest = new RestPage(this.root, this.el, letGo, this.ends.signal);
    watchDrawer(this.el, (drawer) => input.letGoIn(drawer, t("the drawer was closed")), this.ends.signal);
    const el = this.el.querySelector("[data-debug]");
    if (el instanceof HTMLElement) void this.search(el);
    wake();
  }

  /** @param {HTMLElement} el root of the debug interface */
  async search(el) {
    const { Debug } = await import("../dev/debug.js");
    if (!el.isConnected) return; // another interface was opened meanwhile
    this.debug = new Debug(el, this.doors);
    el.removeAttribute("aria-busy");
    this.doors.wake();
  }

  /** End the current interface. */
  leave() {
    const { host } = this.doors;
    this.ends.abort();
    this.debug?.end();
    this.debug = null;
    host.unmountAll(this.el);
  }
}
