// @ts-check
/**
 * The held controls of a frame. The page handles the input; this module reports the places of the
 * controls, and samples the widget.
 *
 * @typedef {import("./frame.js").Frame} Frame
 * @typedef {import("../core/types.js").GateSpec} GateSpec
 * @typedef {import("../core/types.js").Hand} Hand
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 */

const LOOK_EVERY_MS = 250;
/** Elements that stay clickable inside a held control, if the widget's `isFree` permits it. */
const PRESSED = "a, button, input, select, textarea, [role=button]";

export class FrameHeldControls {
  /** @param {Frame} frame */
  constructor(frame) {
    this.frame = frame;
    /** @type {Map<number, HoldSpec>} */
    this.holds = new Map();
    /** @type {Map<number, GateSpec>} */
    this.gates = new Map();
    /**
     * Additional elements that accept a held control's keys.
     *
     * @type {Map<number, {el: HTMLElement}>}
     */
    this.more = new Map();
    this.count = 0;
    this.placed = "";
  }

  /**
   * @param {string} output
   * @param {HoldSpec} spec
   */
  hold(output, spec) {
    const id = this.added(spec.el);
    this.holds.set(id, spec);
    const { keys, pad = "", stays = false } = spec;
    const keysOn = (spec.keysOn ?? []).flatMap(focusable).map((el) => {
      const other = this.added(el);
      this.more.set(other, { el });
      return other;
    });
    this.frame.say({ t: "hold", id, output, keys, keysOn, taps: Object.keys(spec.taps ?? {}), pad, stays });
    this.place();
  }

  /** @param {GateSpec} spec */
  gate(spec) {
    const id = this.added(spec.el);
    this.gates.set(id, spec);
    const { isHeld, timeoutMs, key = "", pad = "" } = spec;
    this.frame.say({ t: "gate", id, isHeld, timeoutMs, key, pad });
    this.place();
  }

  /** @param {HTMLElement} el */
  added(el) {
    if (this.count === 0) {
      const timer = setInterval(() => this.place(), LOOK_EVERY_MS);
      this.frame.end.signal.addEventListener("abort", () => clearInterval(timer));
      addEventListener("scroll", () => this.place(), { capture: true, passive: true });
    }
    this.count += 1;
    el.dataset["focusable"] = String(el.tabIndex >= 0);
    el.tabIndex = -1; // the page's overlay takes the focus
    return this.count;
  }

  /** Report the places of all elements after a change. */
  place() {
    if (this.count === 0) return;
    /** @type {[number, Pick<HoldSpec, "el" | "isFree" | "page">][]} */
    const all = [...this.holds, ...this.more, ...[...this.gates].map(justEl)];
    const places = all.map(([id, { el, isFree, page }]) => {
      const pressed = isFree ? [...el.querySelectorAll(PRESSED)] : [];
      return {
        id,
        box: boxOf(el),
        holes: pressed.filter((one) => isFree && !isFree(one)).map(boxOf),
        label: labelOf(el),
        said: el.getAttribute("aria-valuetext") ?? "",
        isFocusable: el.dataset["focusable"] === "true",
        page: page?.() ?? "none",
      };
    });
    const look = JSON.stringify(places);
    if (look === this.placed) return;
    this.placed = look;
    this.frame.say({ t: "places", places });
  }

  /** @param {any} message */
  take(message) {
    try {
      this.serve(message);
    } catch (error) {
      this.frame.fail(error);
    }
    this.place();
  }

  /** @param {any} message */
  serve(message) {
    const hold = this.holds.get(message.id);
    switch (message.t) {
      case "hand":
        if (hold) this.sample(hold, message);
        break;
      case "held":
        hold?.show(message.state);
        break;
      case "gated":
        this.gates.get(message.id)?.show(message.state);
        break;
      case "tap":
        hold?.taps?.[message.code]?.();
        break;
      case "pace":
        hold?.pace?.(message.way);
        break;
    }
  }

  /**
   * @param {HoldSpec} spec
   * @param {{id: number, n: number, hand: any, dtS: number}} message
   */
  sample(spec, { id, n, hand, dtS }) {
    /** @type {Hand} */
    const known = { ...hand, keys: new Set(hand.keys) };
    this.frame.say({ t: "values", id, n, values: spec.sample(known, dtS) });
  }
}

/** @param {[number, GateSpec]} gate @returns {[number, {el: HTMLElement}]} */
function justEl([id, { el }]) {
  return [id, { el }];
}

/**
 * Return the focusable element: the element itself, or one inside it.
 *
 * @param {HTMLElement} el
 */
function focusable(el) {
  const all = [el, ...el.querySelectorAll("[tabindex]")];
  return all.filter((one) => one instanceof HTMLElement).filter(({ tabIndex }) => tabIndex >= 0);
}

/** @param {Element} el */
function boxOf(el) {
  const { x, y, width, height } = el.getBoundingClientRect();
  return { x, y, width, height };
}

/** @param {HTMLElement} el */
function labelOf(el) {
  const named = el.getAttribute("aria-labelledby")?.split(" ") ?? [];
  const texts = named.map((id) => document.getElementById(id)?.textContent ?? "");
  return el.getAttribute("aria-label") || texts.join(" ").trim() || (el.textContent ?? "").trim().slice(0, 100);
}
