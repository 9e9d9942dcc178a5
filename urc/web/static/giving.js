// @ts-check
/**
 * What widgets that give commands need again and again: `import { Giver, slide } from "urc/giving"`.
 *
 * Knows no socket and no store; a widget brings its own `send`.
 *
 * @typedef {import("./types.js").Outlet} Outlet
 * @typedef {import("./types.js").Value} Value
 * @typedef {import("./types.js").Argument} Argument
 * @typedef {(text: string, names?: Record<string, string | number>) => string} T
 * @typedef {"" | "pending" | "done" | "failed"} Phase
 */

export { Setpoint } from "./setpoint.js";
export { Wish } from "./wish.js";

/** How long what was done is told. */
const TELL_MS = 4000;
/** A finger that rests on a slide for so long has slid it: nobody has to drag. */
const REST_MS = 1500;
const REST_EVERY_MS = 50;
/** A finger that has moved less rests. */
const STILL_PX = 8;
/** Share of the slide's width that a finger must go. */
const WAY = 0.75;

/** One command: given, under way, done or failed. What it shows is what became of it. */
export class Giver {
  /**
   * @param {object} spec
   * @param {(args: Record<string, Value>) => Promise<unknown>} spec.give
   * @param {() => void} spec.show called when any of it has changed
   * @param {T} spec.t
   * @param {AbortSignal} spec.signal
   * @param {number} [spec.everyMs] `newest` gives no more often
   */
  constructor({ give, show, t, signal, everyMs = 100 }) {
    this.give = give;
    this.show = show;
    this.t = t;
    this.everyMs = everyMs;
    /** @type {Phase} */
    this.phase = "";
    this.outcome = "";
    this.reason = t("not ready yet");
    this.isAnswered = false;
    this.isOver = false;
    /** What is to be given next. @type {Record<string, Value> | null} */
    this.next = null;
    this.givenMs = -Infinity;
    /** @type {number | undefined} */
    this.telling = undefined;
    /** @type {number | undefined} */
    this.pacing = undefined;
    signal.addEventListener("abort", () => {
      this.isOver = true;
      this.next = null;
      clearTimeout(this.telling);
      clearTimeout(this.pacing);
    });
  }

  get isReady() {
    return this.reason === "";
  }

  get isPending() {
    return this.phase === "pending";
  }

  /** @param {Outlet | undefined} outlet as `update` was given it */
  take(outlet) {
    this.reason = outlet ? outlet.reason : this.t("no command is bound to it");
    this.isAnswered = outlet?.isAnswered ?? false;
    if (this.reason) this.next = null; // what could not be given is not given later
    this.show();
  }

  /**
   * Give it, unless it is under way already.
   *
   * @param {Record<string, Value>} [args]
   * @returns {Promise<boolean>} whether it was done
   */
  async once(args = {}) {
    if (!this.isReady || this.isPending || this.isOver) return false;
    this.become("pending", this.isAnswered ? this.t("… waiting for the robot") : this.t("… sending"));
    this.givenMs = performance.now();
    try {
      await this.give(args);
      this.become("done", this.isAnswered ? this.t("✓ done") : this.t("✓ sent"), TELL_MS);
      return true;
    } catch (error) {
      const isOurs = error instanceof Error && error.name === "Cancelled";
      const text = error instanceof Error ? error.message : String(error);
      if (isOurs) this.become("", `○ ${text}`, TELL_MS);
      else this.become("failed", `▲ ${text}`);
      return false;
    }
  }

  /**
   * Give it as soon as may be; a newer one takes the place of one that still waits.
   *
   * @param {Record<string, Value>} args
   */
  newest(args) {
    if (!this.isReady || this.isOver) return;
    this.next = args;
    this.goOn();
  }

  goOn() {
    if (this.isPending || this.next === null || this.pacing !== undefined) return;
    const waitMs = this.givenMs + this.everyMs - performance.now();
    if (waitMs > 0) {
      this.pacing = window.setTimeout(() => {
        this.pacing = undefined;
        this.goOn();
      }, waitMs);
      return;
    }
    const args = this.next;
    this.next = null;
    void this.once(args).then(() => this.goOn());
  }

  /**
   * @param {Phase} phase
   * @param {string} outcome
   * @param {number} forMs 0: until something happens
   */
  become(phase, outcome = "", forMs = 0) {
    if (this.isOver) return;
    clearTimeout(this.telling);
    this.phase = phase;
    this.outcome = outcome;
    if (forMs > 0) this.telling = window.setTimeout(() => this.become(""), forMs);
    this.show();
  }

  /**
   * What is to be read below the control.
   *
   * @param {...string} more
   */
  note(...more) {
    const hindrance = this.reason ? `◆ ${this.reason}` : "";
    return [this.outcome, hindrance, ...more].filter(Boolean).join(" · ");
  }
}

/**
 * Make an element a slide: it is done when it is drawn to its end and let go, when a finger has
 * rested on it, or by the arrow keys.
 *
 * @param {HTMLElement} el empty
 * @param {object} spec
 * @param {string} spec.label what it does
 * @param {() => void} spec.done
 * @param {() => void} [spec.touched] called when somebody begins
 * @param {() => boolean} [spec.isReady]
 * @param {AbortSignal} spec.signal
 */
export function slide(el, { label, done, touched, isReady = () => true, signal }) {
  const fill = document.createElement("span");
  fill.className = "urc-slide-fill";
  const knob = document.createElement("span");
  knob.className = "urc-slide-knob";
  knob.setAttribute("aria-hidden", "true");
  knob.textContent = "»";
  const text = document.createElement("span");
  text.className = "urc-slide-text";
  text.textContent = label;
  el.classList.add("urc-slide");
  el.append(fill, text, knob);
  el.tabIndex = 0;
  el.setAttribute("role", "slider");
  el.setAttribute("aria-label", label);
  el.setAttribute("aria-valuemin", "0");
  el.setAttribute("aria-valuemax", "100");
  let share = 0;
  let pointerId = -1;
  let startX = 0;
  let farPx = 0;
  /** @type {number | undefined} */
  let resting;

  /** @param {number} now from 0 to 1 */
  function put(now) {
    share = Math.min(1, Math.max(0, now));
    el.style.setProperty("--urc-slide", String(share));
    el.setAttribute("aria-valuenow", String(Math.round(100 * share)));
  }
  function letGo() {
    const isDone = share >= 1;
    pointerId = -1;
    clearInterval(resting);
    put(0);
    if (isDone && isReady()) done();
  }
  function forget() {
    put(0);
    letGo();
  }
  el.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || pointerId !== -1 || !isReady()) return;
    event.preventDefault();
    el.focus();
    touched?.();
    pointerId = event.pointerId;
    el.setPointerCapture(pointerId);
    startX = event.clientX;
    farPx = 0;
    const width = el.clientWidth || 1;
    el.dataset["way"] = String(width * WAY);
    resting = window.setInterval(() => {
      if (farPx < STILL_PX) put(share + REST_EVERY_MS / REST_MS);
    }, REST_EVERY_MS);
  }, { signal });
  el.addEventListener("pointermove", (event) => {
    if (event.pointerId !== pointerId) return;
    const way = event.clientX - startX;
    farPx = Math.max(farPx, Math.abs(way));
    if (farPx >= STILL_PX) put(way / Number(el.dataset["way"]));
  }, { signal });
  el.addEventListener("pointerup", (event) => {
    if (event.pointerId === pointerId) letGo();
  }, { signal });
  for (const name of ["pointercancel", "lostpointercapture"]) {
    el.addEventListener(name, () => {
      if (pointerId !== -1) forget();
    }, { signal });
  }
  el.addEventListener("keydown", (event) => {
    const way = { ArrowRight: 0.1, ArrowUp: 0.1, ArrowLeft: -0.1, ArrowDown: -0.1 }[event.key];
    if (way === undefined || !isReady()) return;
    event.preventDefault();
    touched?.();
    put(Math.round((share + way) * 10) / 10);
    if (share >= 1) letGo();
  }, { signal });
  el.addEventListener("blur", () => forget(), { signal });
  signal.addEventListener("abort", () => clearInterval(resting));
  put(0);
}

/**
 * What stands between two values of a control.
 *
 * @param {Argument | undefined} argument
 * @param {{step?: unknown, min?: unknown, max?: unknown, unit?: unknown, precision?: unknown}} options
 * @returns {{min: number, max: number, step: number, digits: number, unit: string}}
 */
export function boundsOf(argument, options) {
  const pick = (/** @type {unknown} */ own, /** @type {number | null | undefined} */ theirs, /** @type {number} */ none) =>
    typeof own === "number" ? own : (theirs ?? none);
  const theirs = argument ?? { min: null, max: null };
  // An option may narrow what the command takes, and never widen it.
  const min = Math.max(pick(options.min, theirs.min, 0), theirs.min ?? -Infinity);
  const max = Math.min(pick(options.max, theirs.max, 100), theirs.max ?? Infinity);
  const isWhole = argument?.type === "integer";
  const usual = isWhole ? Math.max(1, Math.round((max - min) / 100)) : niceStep((max - min) / 100);
  const step = typeof options.step === "number" && options.step > 0 ? options.step : usual;
  const digits = typeof options.precision === "number" ? options.precision : digitsOf(step);
  const unit = typeof options.unit === "string" ? options.unit : (argument?.unit ?? "");
  return { min, max: Math.max(min, max), step, digits: isWhole ? 0 : digits, unit };
}

/**
 * Return the nearest value on the grid of steps, within the bounds.
 *
 * @param {number} value
 * @param {{min: number, max: number, step: number}} bounds
 */
export function snapped(value, { min, max, step }) {
  const near = min + Math.round((value - min) / step) * step;
  const inside = Math.min(max, Math.max(min, near));
  return Number(inside.toFixed(10));
}

/**
 * Return where a key of a slider leads; null for a key that means nothing here.
 *
 * @param {string} key
 * @param {number} value
 * @param {{min: number, max: number, step: number}} bounds
 * @returns {number | null}
 */
export function keyed(key, value, bounds) {
  const { min, max, step } = bounds;
  switch (key) {
    case "ArrowRight":
    case "ArrowUp":
      return snapped(value + step, bounds);
    case "ArrowLeft":
    case "ArrowDown":
      return snapped(value - step, bounds);
    case "PageUp":
      return snapped(value + Math.max(step, (max - min) / 10), bounds);
    case "PageDown":
      return snapped(value - Math.max(step, (max - min) / 10), bounds);
    case "Home":
      return min;
    case "End":
      return max;
    default:
      return null;
  }
}

/** @param {number} step the next 1, 2 or 5 of a decade above */
function niceStep(step) {
  if (!(step > 0) || !Number.isFinite(step)) return 1;
  const decade = 10 ** Math.floor(Math.log10(step));
  const share = step / decade;
  const nice = share <= 1 ? 1 : share <= 2 ? 2 : share <= 5 ? 5 : 10;
  return Number((nice * decade).toPrecision(3));
}

/** @param {number} step */
function digitsOf(step) {
  const text = String(step);
  if (text.includes("e-")) return Number(text.split("e-")[1]);
  return text.split(".")[1]?.length ?? 0;
}
