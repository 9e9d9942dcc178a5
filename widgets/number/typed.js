// @ts-check
/** Parser for typed numbers, with the reason for a failure. Pure: no DOM. */

const PLAIN = /^[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d{1,3})?$/i;
/** Unambiguous thousands separators: at least two, or one before a decimal separator. */
const PARTED = /^([+-]?\d{1,3})((?:,\d{3})+)(\.\d*)?$|^([+-]?\d{1,3})((?:\.\d{3})+)(,\d*)?$/;
/** Ambiguous: thousands in English, three decimals in other languages. */
const EITHER = /^[+-]?[1-9]\d{0,2},\d{3}(e[+-]?\d{1,3})?$/i;

/**
 * @param {string} text typed text; blanks and a unit at the end are ignored. A comma is a decimal
 *   separator unless it separates thousands. A single point is always a decimal separator, as on the page
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
 * Return the number with a decimal point and without thousands separators.
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
