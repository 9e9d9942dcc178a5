// @ts-check
/**
 * The views of an attitude. Each view has `show(lean)`, which moves elements but creates no elements.
 *
 * @typedef {import("./angles.js").Lean} Lean
 * @typedef {{show: (lean: Lean) => void}} View
 */
import { attribute, clamp, drawing, format, part, style, svg, write } from "urc/kit";
import { solid } from "./angles.js";

/** Units per degree: 84 degrees are visible from top to bottom. */
const PER_DEGREE = 2;
/** Rungs further from the middle, in degrees, have the class `attitude-far`: they reach the roll scale. */
const FAR = 31;
const BANKS = [-60, -45, -30, -20, -10, 0, 10, 20, 30, 45, 60];
/** Ends of the bars of the axes, in degrees. */
const ENDS = { bank: 90, nose: 90, turn: 180 };

/**
 * @param {HTMLElement} el
 * @param {Readonly<Record<string, unknown>>} options
 * @returns {View}
 */
export function viewOf(el, options) {
  switch (options["view"]) {
    case "outline":
      return new Outline(el, options);
    case "solid":
      return new Solid(el);
    case "axes":
      return new Axes(el);
    default:
      return new Horizon(el, options["view"] === "vehicle");
  }
}

/** The artificial horizon: the world seen from inside, or the vehicle seen from behind. */
class Horizon {
  /**
   * @param {HTMLElement} el
   * @param {boolean} isVehicle whether the vehicle leans instead of the world
   */
  constructor(el, isVehicle) {
    this.isVehicle = isVehicle;
    // The horizon is a separate drawing: rotation within another drawing would lay out all texts again.
    this.sphere = drawing(el, ".attitude-sphere");
    this.world = drawing(el, ".attitude-world");
    this.symbol = drawing(el, ".attitude-symbol");
    this.pointer = drawing(el, ".attitude-pointer");
    /** Rungs and their labels, with their pitch. @type {[SVGElement, number][]} */
    this.rungs = [];
    for (let degrees = -90; degrees <= 90; degrees += 5) {
      if (degrees === 0) continue;
      const [y, half] = [-degrees * PER_DEGREE, degrees % 10 === 0 ? 26 : 12];
      const dashes = degrees < 0 ? "5 3" : "none";
      this.rungs.push([svg("path", { d: `M${-half} ${y}H${half}`, class: "attitude-rung", "stroke-dasharray": dashes }), degrees]);
      if (degrees % 10 !== 0) continue;
      for (const x of [-36, 36]) {
        const label = svg("text", { x, y, class: "attitude-degree" });
        label.textContent = String(Math.abs(degrees));
        this.rungs.push([label, degrees]);
      }
    }
    drawing(el, ".attitude-ladder").replaceChildren(...this.rungs.map(([el]) => el));
    const index = BANKS.map((degrees) =>
      svg("path", { class: "attitude-tick", d: `M0 -84V${degrees % 30 === 0 ? -98 : -92}`, transform: `rotate(${degrees})` }),
    );
    drawing(el, ".attitude-index").replaceChildren(...index);
  }

  /** @param {Lean} lean */
  show({ bank, nose }) {
    const side = (this.isVehicle ? (bank ?? 0) : -(bank ?? 0)).toFixed(2);
    for (const [el, degrees] of this.rungs) el.classList.toggle("attitude-far", Math.abs(degrees - (nose ?? 0)) > FAR);
    style(this.world, "transform", `translateY(${((nose ?? 0) * PER_DEGREE).toFixed(2)}px)`);
    style(this.isVehicle ? this.symbol : this.sphere, "transform", `rotate(${side}deg)`);
    style(this.pointer, "transform", `rotate(${side}deg)`);
  }
}

/** The vehicle from behind and from the side, with its limits. */
class Outline {
  /**
   * @param {HTMLElement} el
   * @param {Readonly<Record<string, unknown>>} options
   */
  constructor(el, options) {
    this.rear = drawing(el, ".attitude-rear");
    this.side = drawing(el, ".attitude-side");
    for (const [name, limit] of [["rear", options["roll_limit"]], ["side", options["pitch_limit"]]]) {
      if (typeof limit === "number") attribute(drawing(el, `.attitude-sector-${name}`), "d", sector(limit));
    }
  }

  /** @param {Lean} lean */
  show({ bank, nose }) {
    style(this.rear, "transform", `rotate(${(bank ?? 0).toFixed(2)}deg)`);
    style(this.side, "transform", `rotate(${(-(nose ?? 0)).toFixed(2)}deg)`);
  }
}

/**
 * Return lines at the limit, on both sides.
 *
 * @param {number} degrees
 */
function sector(degrees) {
  const radians = (Math.min(90, degrees) * Math.PI) / 180;
  const [x, y] = [46 * Math.cos(radians), 46 * Math.sin(radians)];
  return `M0 0L${x.toFixed(1)} ${(-y).toFixed(1)}M0 0L${(-x).toFixed(1)} ${(-y).toFixed(1)}`;
}

/** A body in three dimensions, seen from behind and above. */
class Solid {
  /** @param {HTMLElement} el */
  constructor(el) {
    const root = drawing(el, ".attitude-solids");
    this.faces = Array.from({ length: 6 }, () => svg("polygon", { class: "attitude-face" }));
    root.replaceChildren(...this.faces);
    this.show({ bank: 0, nose: 0, turn: 0 });
  }

  /** @param {Lean} lean */
  show(lean) {
    solid(lean).forEach(({ name, points }, place) => {
      const face = this.faces[place];
      if (!face) return;
      attribute(face, "data-face", name);
      attribute(face, "points", points.map(([x, y]) => `${x.toFixed(3)},${y.toFixed(3)}`).join(" "));
    });
  }
}

/** One bar for each axis. */
class Axes {
  /** @param {HTMLElement} el */
  constructor(el) {
    this.rows = /** @type {const} */ (["bank", "nose", "turn"]).map((name) => {
      const row = part(el, `[data-axis="${name}"]`);
      return { name, fill: part(row, ".attitude-fill"), figure: part(row, ".attitude-figure") };
    });
  }

  /** @param {Lean} lean */
  show(lean) {
    for (const { name, fill, figure } of this.rows) {
      const degrees = lean[name];
      const share = clamp((degrees ?? 0) / ENDS[name], -1, 1) / 2;
      style(fill, "--attitude-from", (0.5 + Math.min(0, share)).toFixed(4));
      style(fill, "--attitude-long", Math.abs(share).toFixed(4));
      write(figure, degrees === null ? "—" : `${format(degrees, 0)}°`);
    }
  }
}
