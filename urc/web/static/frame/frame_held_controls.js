// @ts-check
/**
 * Held controls of third-party widgets. The page handles the input itself. An overlay of the page covers
 * each control of the frame, and takes pointers, keys and gamepads like any held control. The
 * widget receives the input, and replies with values.
 *
 * A frame therefore cannot drive by itself. Nothing is sent without input on the page, or while the
 * widget does not reply during a hold.
 *
 * @typedef {import("./frame_protocol.js").Place} Place
 * @typedef {import("./frame_protocol.js").Said} Said
 * @typedef {import("../core/types.js").Hand} Hand
 * @typedef {import("../core/types.js").Value} Value
 * @typedef {import("./frame_host.js").FrameHost} FrameHost
 */

/** Time limit for the widget's reply to an input; its values do not count after the limit. */
const SILENT_MS = 150;
const MOST_GRIPS = 16;

/** One overlay over a frame. */
class Overlay {
  /**
   * @param {FrameHost} warden
   * @param {number} id
   */
  constructor(warden, id) {
    this.warden = warden;
    this.id = id;
    this.el = document.createElement("div");
    this.el.className = "urc-grip";
    this.el.hidden = true; // until its place is known
    this.el.setAttribute("role", "application");
    /** @type {"none" | "free"} */
    this.page = "none";
    /** @type {Hand | null} */
    this.hand = null;
    /** The widget's values for this input; null before the first reply. @type {Record<string, Value> | null} */
    this.values = null;
    this.asked = 0;
    /** Number of the first request of this gesture. */
    this.first = 0;
    this.answered = 0;
    /** Time of the oldest unanswered request. */
    this.owedMs = 0;
  }

  /**
   * Return the widget's last values for the input.
   *
   * @param {Hand} hand
   * @param {number} dtS
   */
  sample(hand, dtS) {
    const nowMs = performance.now();
    if (hand !== this.hand) {
      this.hand = hand;
      this.values = null;
      this.first = this.asked + 1;
    }
    if (this.answered === this.asked) this.owedMs = nowMs;
    this.asked += 1;
    const { left = 0, top = 0 } = this.warden.frameEl?.getBoundingClientRect() ?? {};
    const { kind, axes, sticks, buttons } = hand;
    const seen = {
      kind, axes, sticks, buttons,
      keys: [...hand.keys],
      x: hand.x - left,
      y: hand.y - top,
      startX: hand.startX - left,
      startY: hand.startY - top,
    };
    this.warden.post({ t: "hand", id: this.id, n: this.asked, hand: seen, dtS });
    return nowMs - this.owedMs > SILENT_MS ? {} : (this.values ?? {});
  }

  /** @param {{n: number, values: Record<string, Value>}} answer */
  take({ n, values }) {
    if (n < this.first || n <= this.answered || n > this.asked) return;
    this.answered = n;
    this.owedMs = performance.now();
    this.values = values;
  }

  /** @param {Place} place */
  lie({ box, holes, label, said, isFocusable, page }) {
    const { el } = this;
    this.page = page;
    el.hidden = false;
    el.style.left = `${box.x}px`;
    el.style.top = `${box.y}px`;
    el.style.width = `${box.width}px`;
    el.style.height = `${box.height}px`;
    const around = `M0 0H${box.width}V${box.height}H0Z`;
    const cut = holes.map((hole) => {
      return `M${hole.x - box.x} ${hole.y - box.y}h${hole.width}v${hole.height}h${-hole.width}Z`;
    });
    el.style.clipPath = holes.length > 0 ? `path(evenodd, "${around}${cut.join("")}")` : "";
    if (isFocusable) el.tabIndex = 0;
    else el.removeAttribute("tabindex");
    el.setAttribute("aria-label", said ? `${label}: ${said}` : label);
  }
}

export class Overlays {
  /** @param {FrameHost} warden */
  constructor(warden) {
    this.warden = warden;
    /** @type {Map<number, Overlay>} */
    this.all = new Map();
  }

  /** Whether a request is unanswered. */
  get isOwed() {
    return [...this.all.values()].some(({ asked, answered }) => asked > answered);
  }

  /** @param {Said} message */
  take(message) {
    if (message.t === "hold") this.hold(message);
    else if (message.t === "gate") this.gate(message);
    else if (message.t === "values") this.all.get(message.id)?.take(message);
    else if (message.t === "places") {
      for (const place of message.places) this.all.get(place.id)?.lie(place);
    }
  }

  /**
   * @param {number} id
   * @returns {Overlay | null} null if there are too many, or the number is in use
   */
  made(id) {
    if (this.all.has(id) || this.all.size >= MOST_GRIPS) return null;
    const { warden } = this;
    const overlay = new Overlay(warden, id);
    this.all.set(id, overlay);
    warden.el.append(overlay.el);
    warden.life.signal.addEventListener("abort", () => {
      this.all.delete(id);
      overlay.el.remove();
    });
    return overlay;
  }

  /** @param {Extract<Said, {t: "hold"}>} message */
  hold({ id, output, keys, keysOn, taps, pad, stays }) {
    const { warden } = this;
    const bound = warden.output(output);
    const overlay = bound && this.made(id);
    if (!bound || !overlay) return;
    const more = keysOn.flatMap((other) => this.made(other)?.el ?? []);
    for (const el of more) el.style.pointerEvents = "none"; // only for focus and keys
    const tapped = taps.map((code) => [code, () => warden.post({ t: "tap", id, code })]);
    warden.doors.input.hold(
      bound,
      {
        el: overlay.el,
        keys, pad, stays,
        keysOn: more,
        taps: Object.fromEntries(tapped),
        pace: (way) => warden.post({ t: "pace", id, way }),
        page: () => overlay.page,
        sample: (hand, dtS) => overlay.sample(hand, dtS),
        // Without a reply there is no sample, which differs from an empty sample.
        show: (state) => warden.post({ t: "held", id, state: overlay.values ? state : { ...state, values: null } }),
      },
      warden.life.signal,
    );
  }

  /** @param {Extract<Said, {t: "gate"}>} message */
  gate({ id, isHeld, timeoutMs, key, pad }) {
    const { warden } = this;
    const overlay = this.made(id);
    if (!overlay) return;
    let seen = "";
    const show = (/** @type {import("../core/types.js").GateState} */ state) => {
      const look = JSON.stringify(state);
      if (look !== seen) warden.post({ t: "gated", id, state });
      seen = look;
    };
    const spec = { el: overlay.el, isHeld, timeoutMs, show, ...(pad && { pad }), ...(key && { key }) };
    warden.doors.input.gate(spec, warden.life.signal);
  }
}
