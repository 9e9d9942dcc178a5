// @ts-check
/** What somebody typed as a number, and why it is none. No DOM. */

const PLAIN = /^[+-]?(\d+(\.\d*)?|\.\d+)(e[+-]?\d{1,3})?$/i;

/**
 * @param {string} text as typed: a comma is a point, blanks and the unit behind it are nothing
 * @param {{min: number, max: number, unit: string, isWhole: boolean}} bounds
 * @returns {{value: number} | {fault: "empty" | "none" | "whole" | "low" | "high"}}
 */
export function numberOf(text, { min, max, unit, isWhole }) {
  let plain = text.replace(/[\s\u202f\u00a0']/g, "").replace("−", "-");
  const tail = unit.replace(/\s/g, "");
  if (tail && plain.endsWith(tail)) plain = plain.slice(0, -tail.length);
  if (!plain.includes(".") && plain.indexOf(",") === plain.lastIndexOf(",")) plain = plain.replace(",", ".");
  if (plain === "") return { fault: "empty" };
  const value = Number(plain);
  if (!PLAIN.test(plain) || !Number.isFinite(value)) return { fault: "none" };
  if (isWhole && !Number.isInteger(value)) return { fault: "whole" };
  if (value < min) return { fault: "low" };
  if (value > max) return { fault: "high" };
  return { value };
}
