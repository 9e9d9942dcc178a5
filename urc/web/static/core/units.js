// @ts-check
/**
 * In which units people want to see values. Inside, and on the wire, all stays as declared.
 *
 * Knows no DOM but the select of the choice, and the device's storage, where it is kept.
 *
 * @typedef {import("./types.js").Conversion} Conversion
 * @typedef {import("./types.js").Held} Held
 */

export const KEY = "urc-units";

/** How units are written for people whose spelling in documents is for keyboards. */
const SIGNS = { deg: "°", "deg/s": "°/s", degC: "°C", degF: "°F", "m/s2": "m/s²", "m/s^2": "m/s²", ohm: "Ω" };

/**
 * Unit of a signal → what people of a system read instead: factor, symbol and, where zero is not
 * zero, the offset.
 *
 * @type {Record<string, Record<string, [number, string, number?]>>}
 */
const SYSTEMS = {
  everyday: {
    "m/s": [3.6, "km/h"],
    rad: [180 / Math.PI, "°"],
    "rad/s": [180 / Math.PI, "°/s"],
    K: [1, "°C", -273.15],
    Pa: [0.01, "hPa"],
  },
  nautical: {
    "m/s": [3600 / 1852, "kn"],
    "km/h": [1 / 1.852, "kn"],
    km: [1 / 1.852, "nmi"],
    rad: [180 / Math.PI, "°"],
    "rad/s": [180 / Math.PI, "°/s"],
    K: [1, "°C", -273.15],
    Pa: [0.01, "hPa"],
  },
  imperial: {
    "m/s": [3600 / 1609.344, "mph"],
    "km/h": [1 / 1.609344, "mph"],
    m: [1 / 0.3048, "ft"],
    km: [1 / 1.609344, "mi"],
    cm: [1 / 2.54, "in"],
    mm: [1 / 25.4, "in"],
    rad: [180 / Math.PI, "°"],
    "rad/s": [180 / Math.PI, "°/s"],
    degC: [1.8, "°F", 32],
    K: [1.8, "°F", -459.67],
    kg: [1 / 0.45359237, "lb"],
    Pa: [1 / 6894.757293168, "psi"],
    kPa: [1 / 6.894757293168, "psi"],
    bar: [14.503773773, "psi"],
  },
};

/**
 * Return the sign of a unit as people write it: "°C" for "degC".
 *
 * @param {string} unit as documents spell it
 */
export function symbolOf(unit) {
  return Object.entries(SIGNS).find(([name]) => name === unit)?.[1] ?? unit;
}

export class Units {
  /** @param {string} system one of the systems; anything else leaves units as they are declared */
  constructor(system = "") {
    this.system = "";
    /** What was asked before. @type {Map<string, Conversion>} */
    this.known = new Map();
    this.use(system);
  }

  /** @param {string} system */
  use(system) {
    this.system = Object.hasOwn(SYSTEMS, system) ? system : "";
    this.known.clear();
  }

  /**
   * Return how values of a unit are shown to people.
   *
   * @param {string} symbol
   * @returns {Conversion}
   */
  shown(symbol) {
    const known = this.known.get(symbol);
    if (known) return known;
    const made = this.make(symbol);
    this.known.set(symbol, made);
    return made;
  }

  /**
   * @param {string} symbol
   * @returns {Conversion}
   */
  make(symbol) {
    const system = SYSTEMS[this.system] ?? {};
    const found = Object.hasOwn(system, symbol) ? system[symbol] : undefined;
    const [factor, shown, offset = 0] = found ?? [1, symbolOf(symbol), 0];
    return { factor, offset, symbol: shown };
  }
}

/** Return the system that was chosen on this device. */
export function chosenSystem() {
  try {
    return localStorage.getItem(KEY) ?? "";
  } catch {
    return ""; // nothing can be kept here
  }
}

/**
 * Let people choose the system, in a select of the page; it is kept on the device.
 *
 * @param {(system: string) => void} use
 */
export function offerSystems(use) {
  use(chosenSystem());
  const choice = document.querySelector("select[data-units-choice]");
  if (choice instanceof HTMLSelectElement) {
    choice.value = chosenSystem();
    if (choice.selectedIndex < 0) choice.value = "";
    choice.addEventListener("change", () => {
      use(choice.value);
      try {
        localStorage.setItem(KEY, choice.value);
      } catch {
        // Private mode: the choice lasts as long as this page.
      }
    });
  }
  addEventListener("storage", ({ key, newValue }) => {
    if (key !== KEY) return;
    use(newValue ?? "");
    if (choice instanceof HTMLSelectElement) choice.value = newValue ?? "";
  });
}

/**
 * Return what leads there; undefined where nothing has to be done.
 *
 * @param {Conversion} conversion
 * @returns {((value: number) => number) | undefined}
 */
export function factorOf({ factor, offset }) {
  return factor === 1 && offset === 0 ? undefined : (value) => value * factor + offset;
}

/**
 * Convert whatever is a number, or numbers; the rest stays.
 *
 * @param {Held} value
 * @param {{factor: number, offset: number} | undefined} conversion
 * @returns {Held}
 */
export function converted(value, conversion) {
  if (!conversion) return value;
  const { factor, offset } = conversion;
  if (typeof value === "number") return value * factor + offset;
  if (Array.isArray(value)) {
    return value.map((each) => (typeof each === "number" ? each * factor + offset : each));
  }
  return value;
}
