// @ts-check
/**
 * The drawer of a phone in landscape, with the controls for which the layout has no place.
 *
 * Its cells are cells of the grid on every other screen: see `urc.web.show.layout` and drawer.css. It
 * covers neither STOP nor the lower corners with the sticks, which stay usable. Whatever is held in
 * the drawer is released when the drawer closes.
 */
import { part } from "./badge.js";

/** Screens with the drawer, as in drawer.css. */
const SCREEN = "(height < 30rem) and (width >= 37.5rem)";
/** Distance of a swipe that closes the drawer. */
const SWIPE_PX = 40;
/** A tap there leaves the drawer open: it is the other hand, which drives or stops. */
const OTHER_HAND = '[data-drawer-handle], [data-footprint="stick"], .urc-controls';

/**
 * @param {HTMLElement} stage
 * @param {(drawer: HTMLElement) => void} letGo releases the controls that are held in the drawer
 * @param {AbortSignal} signal
 */
export function watchDrawer(stage, letGo, signal) {
  if (!stage.querySelector("[data-drawer]")) return;
  const drawer = new Drawer(stage, letGo);
  drawer.listen(signal);
  signal.addEventListener("abort", () => drawer.close());
}

class Drawer {
  /**
   * @param {HTMLElement} stage
   * @param {(drawer: HTMLElement) => void} letGo
   */
  constructor(stage, letGo) {
    this.el = part(stage, "[data-drawer]");
    this.handle = part(stage, "[data-drawer-handle]");
    this.head = part(stage, "[data-drawer-head]");
    this.quit = part(stage, "[data-drawer-close]");
    this.grid = part(stage, ".urc-grid");
    this.letGo = letGo;
    /** Elements under the fingers in the drawer. @type {Map<number, Element>} */
    this.fingers = new Map();
    /** Start of a swipe on the head. @type {{id: number, x: number, y: number} | null} */
    this.swipe = null;
  }

  get isOpen() {
    return this.el.hasAttribute("data-open");
  }

  /** @param {AbortSignal} signal */
  listen(signal) {
    const options = { signal };
    this.handle.addEventListener("click", (event) => {
      if (this.isOpen) this.close();
      else this.open(event instanceof PointerEvent && event.pointerType !== "");
    }, options);
    this.quit.addEventListener("click", () => this.close(), options);
    // Not on the window: there, Escape means STOP, unless an open part of the page closes with it.
    document.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || event.defaultPrevented || !this.isOpen) return;
      event.preventDefault();
      this.close();
    }, options);
    document.addEventListener("pointerdown", (event) => this.down(event), { signal, capture: true });
    for (const name of /** @type {const} */ (["pointerup", "pointercancel"])) {
      document.addEventListener(name, (event) => this.up(event), { signal, capture: true });
    }
    const pages = new MutationObserver(() => this.close()); // a tab, or the page with more widgets
    pages.observe(this.grid, { attributeFilter: ["data-page"] });
    signal.addEventListener("abort", () => pages.disconnect());
    // On another screen, the cells are in the grid, and nothing is open.
    matchMedia(SCREEN).addEventListener("change", () => this.close(), options);
  }

  /** @param {boolean} byPointer whether a finger or a mouse opened it, so that the focus stays */
  open(byPointer) {
    this.el.toggleAttribute("data-open", true);
    this.handle.setAttribute("aria-expanded", "true");
    if (!byPointer) this.quit.focus();
  }

  close() {
    if (!this.isOpen) return;
    for (const [id, target] of this.fingers) releaseUnder(target, id, this.el);
    this.fingers.clear();
    this.swipe = null;
    const hadFocus = this.el.contains(document.activeElement);
    if (hadFocus && document.activeElement instanceof HTMLElement) document.activeElement.blur();
    this.letGo(this.el);
    this.el.removeAttribute("data-open");
    this.handle.setAttribute("aria-expanded", "false");
    if (hadFocus) this.handle.focus();
  }

  /** @param {PointerEvent} event */
  down(event) {
    if (!this.isOpen || !(event.target instanceof Element)) return;
    const { target, pointerId, clientX, clientY } = event;
    if (this.el.contains(target)) {
      this.fingers.set(pointerId, target);
      if (this.head.contains(target)) this.swipe = { id: pointerId, x: clientX, y: clientY };
    } else if (!target.closest(OTHER_HAND)) {
      this.close();
    }
  }

  /** @param {PointerEvent} event */
  up({ type, pointerId, clientX, clientY }) {
    this.fingers.delete(pointerId);
    if (this.swipe?.id !== pointerId) return;
    const { x, y } = this.swipe;
    this.swipe = null;
    if (type === "pointerup" && Math.max(Math.abs(clientX - x), clientY - y) > SWIPE_PX) this.close();
  }
}

/**
 * End the gesture of a finger: whatever has captured the pointer loses it.
 *
 * @param {Element} target
 * @param {number} pointerId
 * @param {Element} end ancestor at which the search ends
 */
function releaseUnder(target, pointerId, end) {
  for (let el = /** @type {Element | null} */ (target); el && el !== end; el = el.parentElement) {
    if (el.hasPointerCapture(pointerId)) el.releasePointerCapture(pointerId);
  }
}
