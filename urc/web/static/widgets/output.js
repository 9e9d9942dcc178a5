// @ts-check
/**
 * From what a widget gives to what a command takes. Knows no widget, no socket.
 *
 * @typedef {import("../core/types.js").Given} Given
 * @typedef {import("../core/types.js").Value} Value
 *
 * @typedef {object} Range Where -1, 0 and 1 of a widget lie in an argument of the command.
 * @property {number} min
 * @property {number} max
 * @property {number} rest What stops it.
 * @property {boolean} isWhole
 *
 * @typedef {object} Output What an output of a widget is bound to.
 * @property {string} command
 * @property {Record<string, string>} names Argument of the command → argument of the output, where
 *   they are not called the same.
 * @property {Record<string, Value>} fixed Argument of the command → value that it always has.
 * @property {Record<string, Range>} ranges Argument of the command → what a widget's -1 to 1 means.
 * @property {Record<string, Value>} neutral Argument of the command → value that stops it, for those
 *   that a hand may let go one by one.
 * @property {string} line The transport without which the command cannot be given; "" when one is
 *   made for each command.
 * @property {string} refusal Why a widget can never give it; "" when it can.
 * @property {boolean} isHeld Whether it is motion, and given by holding.
 * @property {boolean} [moves] Whether it moves something by itself, without a hand that holds it.
 * @property {boolean} [mayMove] Whether it moves something with some arguments.
 * @property {number} leaseMs How long motion lasts when nothing is heard.
 * @property {boolean} isAnswered Whether the robot says that it was done.
 * @property {string} [title] What the command is called; "" when the driver does not say.
 * @property {Record<string, import("../core/types.js").Argument>} [arguments] Those that are not fixed.
 * @property {import("../core/types.js").Question[]} [asks] What people are asked before it.
 * @property {{text: string, what: string}[]} [steps] Of a sequence.
 */

/**
 * Return what a widget may know of the command that an output of it is bound to.
 *
 * @param {Output | undefined} output
 * @returns {import("../core/types.js").Described | null}
 */
export function describe(output) {
  if (output === undefined) return null;
  const { command, title = "", asks = [], steps = [], names } = output;
  const known = Object.entries(output.arguments ?? {});
  const called = known.map(([name, one]) => [Object.hasOwn(names, name) ? names[name] : name, one]);
  return { command, title, asks, steps, arguments: Object.fromEntries(called) };
}

/**
 * Return the command's arguments.
 *
 * A value goes where `names` says, else to the argument of its own name. What is fixed, no widget
 * can change.
 *
 * @template {Given} V
 * @param {Output} output
 * @param {Record<string, V>} given by the names that the widget's manifest declares
 * @returns {Record<string, V | Value>}
 */
export function argumentsOf({ names, fixed, ranges = {}, isHeld }, given) {
  const renamed = new Set(Object.values(names));
  // What a control that is held gives beyond what the command takes, it gives to nobody.
  const pairs = Object.entries(given).filter(([name]) => !isHeld && !renamed.has(name));
  for (const [target, name] of Object.entries(names)) {
    const value = Object.hasOwn(given, name) ? given[name] : undefined;
    if (value !== undefined) pairs.push([target, value]);
  }
  const scaled = pairs.map(([target, value]) => [target, scale(value, ranges[target])]);
  return Object.fromEntries([...scaled, ...Object.entries(fixed)]);
}

/**
 * @template {Given} V
 * @param {V | undefined} value
 * @param {Range | undefined} range
 * @returns {V | Value}
 */
function scale(value, range) {
  if (typeof value !== "number" || !range) return value ?? null;
  const share = Math.min(1, Math.max(-1, value));
  const end = share < 0 ? range.min : range.max;
  const scaled = range.rest + Math.abs(share) * (end - range.rest);
  return range.isWhole ? Math.round(scaled) : Math.round(scaled * 1e6) / 1e6;
}
