// @ts-check
/**
 * From what a widget gives to what a command takes. Knows no widget, no socket.
 *
 * @typedef {import("./types.js").Value} Value
 *
 * @typedef {object} Output What an output of a widget is bound to.
 * @property {string} command
 * @property {Record<string, string>} names Argument of the command → argument of the output, where
 *   they are not called the same.
 * @property {Record<string, Value>} fixed Argument of the command → value that it always has.
 * @property {string} line The transport without which the command cannot be given; "" when one is
 *   made for each command.
 * @property {string} refusal Why a widget can never give it; "" when it can.
 * @property {boolean} isAnswered Whether the robot says that it was done.
 */

/**
 * Return the command's arguments.
 *
 * A value goes where `names` says, else to the argument of its own name. What is fixed, no widget
 * can change.
 *
 * @param {Output} output
 * @param {Record<string, Value>} given by the names that the widget's manifest declares
 * @returns {Record<string, Value>}
 */
export function argumentsOf({ names, fixed }, given) {
  const renamed = new Set(Object.values(names));
  const pairs = Object.entries(given).filter(([name]) => !renamed.has(name));
  for (const [target, name] of Object.entries(names)) {
    const value = Object.hasOwn(given, name) ? given[name] : undefined;
    if (value !== undefined) pairs.push([target, value]);
  }
  return Object.fromEntries([...pairs, ...Object.entries(fixed)]);
}
