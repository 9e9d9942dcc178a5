// @ts-check
/**
 * The conversion of a widget's values to a command's arguments. The module uses no widget and no
 * socket.
 *
 * @typedef {import("../core/types.js").Given} Given
 * @typedef {import("../core/types.js").Value} Value
 *
 * @typedef {object} Range Values of an argument for -1, 0 and 1 of a widget.
 * @property {number} min
 * @property {number} max
 * @property {number} rest Value that stops the motion.
 * @property {boolean} isWhole
 *
 * @typedef {object} Output The binding of a widget's output.
 * @property {string} command
 * @property {Record<string, string>} names Argument of the command → argument of the output, where their
 *   names differ.
 * @property {Record<string, Value>} fixed Argument of the command → its fixed value.
 * @property {Record<string, Range>} ranges Argument of the command → its values for -1 to 1 of a widget.
 * @property {Record<string, Value>} neutral Argument of the command → value that stops it, for arguments
 *   that can be released one by one.
 * @property {string} line The transport that the command needs; "" if it is opened for each command.
 * @property {string} refusal Why a widget can never run it, or "".
 * @property {boolean} isHeld Whether it is a held command.
 * @property {import("../core/types.js").Role} [role] Role that the command needs.
 * @property {boolean} [moves] Whether it always starts autonomous motion.
 * @property {boolean} [mayMove] Whether it starts motion with some arguments.
 * @property {number} leaseMs Time for which motion outlives the last tick, in milliseconds.
 * @property {import("../control/shown_images.js").Sight | null} [sees] Image that a held command requires.
 * @property {boolean} isAnswered Whether the robot acknowledges it.
 * @property {string} [title] Title of the command; "" if the driver has none.
 * @property {Record<string, import("../core/types.js").Argument>} [arguments] Arguments that are not fixed.
 * @property {import("../core/types.js").Question[]} [asks] Confirmations before it.
 * @property {{text: string, what: string}[]} [steps] Steps of a sequence.
 */

/**
 * Return the public description of an output's command.
 *
 * @param {Output | undefined} output
 * @returns {import("../core/types.js").Described | null}
 */
export function describe(output) {
  if (output === undefined) return null;
  const { command, title = "", asks = [], steps = [], names } = output;
  const known = Object.entries(output.arguments ?? {});
  const called = known.map(([name, one]) => [
    Object.hasOwn(names, name) ? names[name] : name,
    { ...one, name },
  ]);
  return { command, title, asks, steps, arguments: Object.fromEntries(called) };
}

/**
 * Return the command's arguments.
 *
 * A value sets the argument in `names`, or else the argument with the same name. Widgets cannot
 * change fixed values.
 *
 * @template {Given} V
 * @param {Output} output
 * @param {Record<string, V>} given values by the names of the widget's manifest
 * @returns {Record<string, V | Value>}
 */
export function argumentsOf({ names, fixed, ranges = {}, isHeld }, given) {
  const renamed = new Set(Object.values(names));
  // A held control may have more values than the command has arguments; extra values are dropped.
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

/**
 * Return the goals whose command is bound to an output, with the names of the outputs' arguments.
 *
 * @param {Iterable<[string, Output]>} outputs
 * @param {readonly import("../core/types.js").SentGoal[]} goals
 * @returns {import("../core/types.js").Goal[]}
 */
export function goalsOf(outputs, goals) {
  const bound = [...outputs];
  return goals.flatMap(({ command, title: _, places, ...goal }) => {
    const found = bound.find(([, output]) => output.command === command);
    if (!found) return [];
    const [output, { names, fixed }] = found;
    const given = Object.entries(places).filter(([name]) => !Object.hasOwn(fixed, name));
    const args = Object.fromEntries(given.map(([name, value]) => [Object.hasOwn(names, name) ? names[name] : name, value]));
    return [{ ...goal, output, args }];
  });
}
