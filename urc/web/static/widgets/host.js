// @ts-check
/**
 * The life of the widgets: each in its cell, each on its own.
 *
 * The server has drawn the templates already. Here the modules are loaded and mounted, and called in
 * animation frames when an input of theirs has changed; a cell that cannot be seen is sent nothing.
 *
 * @typedef {import("./cell.js").Doors} Doors
 * @typedef {import("../live/store.js").Store} Store
 */
import { Cell } from "./cell.js";
import { Pace } from "./pace.js";

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
    this.pace = new Pace();
    /** Cells that wait for their turn, longest first. @type {Set<Cell>} */
    this.waiting = new Set();
    /** Drawn in the frame that is being painted; 0 when none is. */
    this.drawn = 0;
    this.begunMs = 0;
    // A message that is sent in a frame comes when that frame was painted.
    this.painted = new MessageChannel();
    this.painted.port1.onmessage = () => {
      this.pace.learn(this.drawn, performance.now() - this.begunMs, this.cells.size);
      this.drawn = 0;
    };
    /** Whether also cells that cannot be seen are called. */
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
   * Let the widgets in `root` come up; resolves when all of them stand or have failed.
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
    if (cell.config.gate) this.doors.input.gated.add(cell.el);
    return cell.mount();
  }

  /**
   * A widget that does not ship with URC lives in a frame.
   *
   * @param {HTMLElement} el
   */
  async mountForeign(el) {
    const { Warden } = await import("../frame/warden.js"); // most pages have none
    if (el.isConnected && !this.cells.has(el)) await this.mount(new Warden(el, this.doors));
  }

  /**
   * End the widgets that live in `root`; their elements are the caller's.
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
      this.doors.input.gated.delete(cell.el);
      cell.unmount();
    }
  }

  /**
   * Let the widgets draw what is new; where that is too much for one frame, in turn.
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

  /** Names of the images that can be seen now, each once, in a steady order. */
  pictures() {
    if (!this.store.hasPictures) return [];
    const names = new Set();
    for (const cell of this.cells.values()) {
      for (const name of cell.pictures(this.store)) names.add(name);
    }
    return [...names].sort();
  }
}
