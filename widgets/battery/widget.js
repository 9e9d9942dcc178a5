// @ts-check
/** @typedef {import("../../urc/web/static/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/types.js").Instance} Instance */

/**
 * A rectangle in the units of a drawing.
 *
 * @typedef {{x: number, y: number, w: number, h: number}} Box
 */

/** The inside of each drawing's shell, as in the template. @type {Record<string, Box>} */
const INSIDE = {
  lying: { x: 12, y: 12, w: 168, h: 88 },
  standing: { x: 12, y: 28, w: 88, h: 168 },
};

/** How far from the inside the tip of a limit's mark is, its height, and half its width. */
const TIP = 12;
const HIGH = 8;
const HALF = 5;

/** Of a unit's character against a digit's. */
const UNIT_WIDTH = 0.86;

const ALARMS = {
  "": "",
  lolo: "▲ Very low",
  low: "◆ Low",
  high: "◆ High",
  hihi: "▲ Very high",
};

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el }) {
    const root = find(el, ".battery");
    const meter = find(el, ".battery-meter");
    const note = find(el, ".battery-note");
    const digits = [...el.querySelectorAll(".battery-digits")];
    const units = [...el.querySelectorAll(".battery-unit")];
    const pictures = Object.entries(INSIDE).map(([name, inside]) => ({
      inside,
      isLying: name === "lying",
      full: find(el, `.battery-${name} .battery-full`),
      limits: find(el, `.battery-${name} .battery-limits`),
    }));
    const put = writer();

    return {
      update({ level }) {
        if (!level) return;
        const { signal } = level;
        const least = signal.min ?? 0;
        const most = signal.max ?? 100;
        const known = typeof level.value === "number" ? level.value : null;
        const share = known === null ? 0 : clamp((known - least) / (most - least));
        const symbol = known === null ? "" : (signal.unit ?? "%");
        const marks = Object.values(signal.limits ?? {})
          .map((limit) => (limit - least) / (most - least))
          .filter((place) => place > 0 && place < 1);

        put(root, "data-state", level.state);
        put(root, "data-alarm", level.alarm);
        if (root instanceof HTMLElement) {
          const characters = level.text.length + UNIT_WIDTH * symbol.length;
          root.style.setProperty("--battery-characters", String(characters));
        }
        for (const text of digits) put(text, "", level.text);
        for (const text of units) put(text, "", symbol);
        put(note, "", noteOf(level));
        for (const { inside, isLying, full, limits } of pictures) {
          putBox(put, full, filled(inside, share, isLying));
          put(limits, "d", marks.map((place) => mark(inside, place, isLying)).join(""));
        }

        put(meter, "aria-valuemin", String(least));
        put(meter, "aria-valuemax", String(most));
        put(meter, "aria-valuenow", known === null ? null : String(known));
        put(meter, "aria-valuetext", spoken(level, symbol));
      },
    };
  },
};

/**
 * The part of the inside that is full: a lying battery fills from the left, a standing one from
 * below.
 *
 * @param {Box} inside
 * @param {number} share 0..1
 * @param {boolean} isLying
 * @returns {Box}
 */
function filled({ x, y, w, h }, share, isLying) {
  if (isLying) return { x, y, w: share * w, h };
  return { x, y: y + (1 - share) * h, w, h: share * h };
}

/**
 * Two triangles that point at the shell from outside, where a limit is.
 *
 * @param {Box} inside
 * @param {number} place 0..1
 * @param {boolean} isLying
 */
function mark({ x, y, w, h }, place, isLying) {
  if (isLying) {
    const at = (x + place * w).toFixed(1);
    const [above, below] = [y - TIP, y + h + TIP];
    return (
      `M${at} ${above}l-${HALF}-${HIGH}h${2 * HALF}z` +
      `M${at} ${below}l-${HALF} ${HIGH}h${2 * HALF}z`
    );
  }
  const at = (y + (1 - place) * h).toFixed(1);
  const [left, right] = [x - TIP, x + w + TIP];
  return (
    `M${left} ${at}l-${HIGH}-${HALF}v${2 * HALF}z` + `M${right} ${at}l${HIGH}-${HALF}v${2 * HALF}z`
  );
}

/** @param {Reading} level */
function noteOf(level) {
  if (level.state === "none") return "no value yet";
  if (level.state === "gone") return `last seen ${level.age} ago`;
  const old = level.state === "stale" ? `${level.age} old` : "";
  return [ALARMS[level.alarm], old].filter(Boolean).join(" · ");
}

/**
 * @param {Reading} level
 * @param {string} symbol
 */
function spoken(level, symbol) {
  if (level.value === null) return "unknown";
  const note = noteOf(level).replace(/[▲◆] /, "");
  return `${level.text} ${symbol}${note ? `, ${note}` : ""}`;
}

/** @param {number} share */
function clamp(share) {
  return Math.min(1, Math.max(0, share));
}

/**
 * @param {Element} root
 * @param {string} selector
 */
function find(root, selector) {
  const found = root.querySelector(selector);
  if (!found) throw new Error(`the template has no ${selector}`);
  return found;
}

/** @typedef {(el: Element, name: string, value: string | null) => void} Put */

/**
 * Return a function that writes an attribute (or the text, for the name "") only when it changes.
 *
 * @returns {Put}
 */
function writer() {
  /** @type {Map<Element, Map<string, string | null>>} */
  const written = new Map();
  return (el, name, value) => {
    const known = written.get(el) ?? new Map();
    written.set(el, known);
    if (known.get(name) === value) return;
    known.set(name, value);
    if (name === "") el.textContent = value;
    else if (value === null) el.removeAttribute(name);
    else el.setAttribute(name, value);
  };
}

/**
 * @param {Put} put
 * @param {Element} rect
 * @param {Box} box
 */
function putBox(put, rect, box) {
  put(rect, "x", box.x.toFixed(1));
  put(rect, "y", box.y.toFixed(1));
  put(rect, "width", box.w.toFixed(1));
  put(rect, "height", box.h.toFixed(1));
}
