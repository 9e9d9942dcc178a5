// @ts-check
/**
 * The life of the widgets: each in its cell, each on its own.
 *
 * The server has drawn the templates already. Here the modules are loaded and mounted, and called in
 * animation frames when an input of theirs has changed; a cell that cannot be seen is sent nothing.
 *
 * @typedef {import("./cell.js").Doors} Doors
 * @typedef {import("./store.js").Store} Store
 */
import { Cell } from "./cell.js";

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
      const cell = new Cell(el, this.doors);
      this.cells.set(el, cell);
      this.sight.observe(el);
      this.sizes.observe(el);
      mounted.push(cell.mount());
    }
    await Promise.all(mounted);
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
      cell.unmount();
    }
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    for (const cell of this.cells.values()) cell.frame(this.store, nowMs);
  }

  /** Names of the images that can be seen now, each once, in a steady order. */
  pictures() {
    const names = [...this.cells.values()].flatMap((cell) => cell.pictures(this.store));
    return [...new Set(names)].sort();
  }
}
