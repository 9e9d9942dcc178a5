// @ts-check
/**
 * The lifecycle of the widgets, each in its cell.
 *
 * The server has rendered the templates. This module loads and mounts the modules, and calls them in
 * animation frames after a change of their inputs; hidden cells get no data.
 *
 * @typedef {import("./cell.js").Doors} Doors
 * @typedef {import("../live/store.js").Store} Store
 */
import { Cell } from "./cell.js";
import { DrawScheduler } from "./draw_scheduler.js";

export class Host {
  /**
   * @param {Store} store
   * @param {Omit<Doors, "store">} doors
   */
  constructor(store, doors) {
    this.store = store;
    /** @type {Doors} */
    this.doors = { ...doors, store };
    /** @type {Map<Element, Cell>} */
    this.cells = new Map();
    this.pace = new DrawScheduler();
    /** Cells that wait for their turn, oldest first. @type {Set<Cell>} */
    this.waiting = new Set();
    /** Number of widgets drawn in the current frame; 0 without a frame. */
    this.drawn = 0;
    this.begunMs = 0;
    // A message posted in a frame arrives after its painting.
    this.painted = new MessageChannel();
    this.painted.port1.onmessage = () => {
      this.pace.learn(this.drawn, performance.now() - this.begunMs, this.cells.size);
      this.drawn = 0;
    };
    /** Whether hidden cells are also called. */
    this.isAllInSight = false;
    this.sight = new IntersectionObserver((entries) => {
      for (const entry of entries) {
        const cell = this.cells.get(entry.target);
        if (cell) cell.isVisible = entry.isIntersecting || this.isAllInSight;
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

  /**
   * Start the widgets in `root`; resolves when all of them are mounted or have failed.
   *
   * @param {ParentNode} root
   */
  async mountAll(root) {
    const mounted = [];
    for (const el of root.querySelectorAll("[data-config]")) {
      if (!(el instanceof HTMLElement) || this.cells.has(el)) continue;
      mounted.push(el.dataset["frame"] ? this.mountForeign(el) : this.mount(new Cell(el, this.doors)));
    }
    await Promise.all(mounted);
  }

  /** @param {Cell} cell */
  mount(cell) {
    this.cells.set(cell.el, cell);
    this.sight.observe(cell.el);
    this.sizes.observe(cell.el);
    if (cell.config.deadMan) this.doors.input.gated.add(cell.el);
    return cell.mount();
  }

  /**
   * Mount a third-party widget in a frame.
   *
   * @param {HTMLElement} el
   */
  async mountForeign(el) {
    // Before the first await: until the dead-man control has loaded, nothing can be driven.
    if (JSON.parse(el.dataset["config"] ?? "{}").deadMan) this.doors.input.gated.add(el);
    const { FrameHost } = await import("../frame/frame_host.js"); // most pages do not need it
    if (el.isConnected && !this.cells.has(el)) await this.mount(new FrameHost(el, this.doors));
  }

  /**
   * End the widgets in `root`; their elements belong to the caller.
   *
   * @param {Node} root
   */
  unmountAll(root) {
    for (const [el, cell] of this.cells) {
      if (!root.contains(el)) continue;
      this.cells.delete(el);
      this.sight.unobserve(el);
      this.sizes.unobserve(el);
      this.waiting.delete(cell);
      cell.unmount();
    }
    for (const el of this.doors.input.gated) if (root.contains(el)) this.doors.input.gated.delete(el);
  }

  /** Whether any widget has a signal as its input. @param {string} name */
  shows(name) {
    for (const cell of this.cells.values()) if (cell.shows(name)) return true;
    return false;
  }

  /**
   * Make the widgets draw their changes; they take turns if one frame is too short for all.
   *
   * @param {number} nowMs
   */
  frame(nowMs) {
    let left = this.pace.begin(this.cells.size);
    if (left === 0) {
      this.doors.again();
      return;
    }
    let drawn = 0;
    const draw = (/** @type {Cell} */ cell) => {
      const news = cell.news(this.store, nowMs);
      if (news === 1 && left <= 0) {
        this.waiting.add(cell);
        return;
      }
      this.waiting.delete(cell);
      if (news === 0) return;
      drawn += 1;
      left -= 1;
      cell.show(this.store, nowMs);
    };
    for (const cell of [...this.waiting]) draw(cell);
    for (const cell of this.cells.values()) {
      if (!this.waiting.has(cell)) draw(cell);
    }
    const isTelling = this.pace.end(drawn, this.waiting.size);
    if (this.waiting.size > 0) this.doors.again();
    if (this.drawn > 0 || !isTelling) return;
    this.drawn = drawn;
    this.begunMs = nowMs;
    this.painted.port2.postMessage(null);
  }

  /** Return the names of the visible images, each once, in a stable order. */
  pictures() {
    if (!this.store.hasPictures) return [];
    const names = new Set();
    for (const cell of this.cells.values()) {
      for (const name of cell.pictures(this.store)) names.add(name);
    }
    return [...names].sort();
  }
}
