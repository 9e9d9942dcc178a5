// @ts-check
/** What somebody typed as a number, and why it is none. No DOM. */

const PLAIN = /^[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d{1,3})?$/i;
/** Thousands are parted, twice or with a decimal sign behind them: nothing else can be meant. */
const PARTED = /^([+-]?\d{1,3})((?:,\d{3})+)(\.\d*)?$|^([+-]?\d{1,3})((?:\.\d{3})+)(,\d*)?$/;
/** A thousand here, and one with three decimals there. */
const EITHER = /^[+-]?[1-9]\d{0,2},\d{3}(e[+-]?\d{1,3})?$/i;

/**
 * @param {string} text as typed: blanks and the unit behind it are nothing, a comma is a point unless
 *   it parts thousands; a point alone is always one, since that is how numbers are shown
 * @param {{min: number, max: number, unit: string, isWhole: boolean}} bounds
 * @returns {{value: number} | {fault: "empty" | "none" | "whole" | "low" | "high"}
 *   | {fault: "comma", either: [number, number]}}
 */
export function numberOf(text, { min, max, unit, isWhole }) {
  let typed = text.replace(/[\s\u202f\u00a0'’]/g, "").replace("−", "-");
  const tail = unit.replace(/\s/g, "");
  if (tail && typed.endsWith(tail)) typed = typed.slice(0, -tail.length);
  if (typed === "") return { fault: "empty" };
  if (EITHER.test(typed)) {
    return { fault: "comma", either: [Number(typed.replace(",", ".")), Number(typed.replace(",", ""))] };
  }
  const plain = plainOf(typed);
  const value = Number(plain);
  if (!PLAIN.test(plain) || !Number.isFinite(value)) return { fault: "none" };
  if (isWhole && !Number.isInteger(value)) return { fault: "whole" };
  if (value < min) return { fault: "low" };
  if (value > max) return { fault: "high" };
  return { value };
}

/**
 * Return a number with a point for its decimals and nothing between its thousands.
 *
 * @param {string} typed
 */
function plainOf(typed) {
  const signs = typed.replace(/[^.,]/g, "");
  if (signs === ",") return typed.replace(",", ".");
  if (signs.length < 2 || !PARTED.test(typed)) return typed;
  const decimal = new Set(signs).size === 2 ? signs.slice(-1) : "";
  return [...typed].map((each) => (each === decimal ? "." : /[.,]/.test(each) ? "" : each)).join("");
}
