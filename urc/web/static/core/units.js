// @ts-check
/**
 * Displayed units of values. Internally and in messages, values keep their declared unit.
 *
 * The module uses only the select element of the choice, and the device's storage.
 *
 * @typedef {import("./types.js").Conversion} Conversion
 * @typedef {import("./types.js").Held} Held
 */

export const KEY = "urc-units";

/** Symbols of units with a keyboard spelling in documents. */
const SIGNS = { deg: "°", "deg/s": "°/s", degC: "°C", degF: "°F", "m/s2": "m/s²", "m/s^2": "m/s²", ohm: "Ω" };

/**
 * Unit of a signal → displayed unit in a unit system: factor, symbol and, for units with another zero,
 * the offset.
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
 * Return the symbol of a unit: "°C" for "degC".
 *
 * @param {string} unit spelling in documents
 */
export function symbolOf(unit) {
  return Object.entries(SIGNS).find(([name]) => name === unit)?.[1] ?? unit;
}

export class Units {
  /** @param {string} system name of a unit system; any other text leaves units as declared */
  constructor(system = "") {
    this.system = "";
    /** Cached conversions. @type {Map<string, Conversion>} */
    this.known = new Map();
    this.use(system);
  }

  /** @param {string} system */
  use(system) {
    this.system = Object.hasOwn(SYSTEMS, system) ? system : "";
    this.known.clear();
  }

  /**
   * Return the conversion to the displayed unit.
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

/** Return the stored unit system of this device. */
export function chosenSystem() {
  try {
    return localStorage.getItem(KEY) ?? "";
  } catch {
    return ""; // no storage
  }
}

/**
 * Offer the unit systems in a select element of the page; the device stores the choice.
 *
 * @param {(system: string) => void} use
 */
export function offerSystems(use) {
  use(chosenSystem());
  const choice = document.querySelector("select[data-units-choice]");
  // theme.js shows and stores the choice on every page.
  if (choice instanceof HTMLSelectElement) choice.addEventListener("change", () => use(choice.value));
  addEventListener("storage", ({ key, newValue }) => {
    if (key !== KEY) return;
    use(newValue ?? "");
    if (choice instanceof HTMLSelectElement) choice.value = newValue ?? "";
  });
}

/**
 * Return the conversion function; undefined for the identity.
 *
 * @param {Conversion} conversion
 * @returns {((value: number) => number) | undefined}
 */
export function factorOf({ factor, offset }) {
  return factor === 1 && offset === 0 ? undefined : (value) => value * factor + offset;
}

/**
 * Convert a number or numbers; other values stay as they are.
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
