// @ts-check
/**
 * Texts of the page in the user's language. English is the key and the fallback.
 *
 * The import map resolves `urc/words` to the table of the language chosen by the server.
 */
import table from "urc/words";

/** @type {Readonly<Record<string, string>>} */
const words = table;

/**
 * @param {string} text
 * @param {Readonly<Record<string, string | number>>} [names] value of each `{name}`
 * @returns {string}
 */
export function t(text, names = {}) {
  const said = Object.hasOwn(words, text) ? (words[text] ?? text) : text;
  return said.replace(/\{([a-z_]+)\}/g, (hole, name) =>
    Object.hasOwn(names, name) ? String(names[name]) : hole,
  );
}

/**
 * Messages from the server about the controls. The server sends them in English; this module
 * translates messages with a fixed form.
 */
const SENTENCES = [
  mark("Stopped by {name}. Reset to drive again."),
  mark("{name} has the controls"),
  mark("{name} has already asked for control"),
  mark("No screen is asking you for control"),
  mark("watchers cannot drive"),
  mark("watchers can stop the robot, but cannot reset it"),
  mark("Taking over needs the role maintain"),
  mark("nothing is stopped"),
  mark("STOP was pressed again: reset it again"),
  mark("Take control first"),
  mark("Control changed hands meanwhile"),
  mark("No current image of the camera"),
  mark("Image too old: let go, then start again"),
  mark("Slow link: let go, then start again"),
  mark("no command of this robot requires an image"),
  mark("Stopped: let go, then start again"),
  mark("Stopped: take control again"),
  mark("Lost contact while driving"),
  mark("Link too slow: your input arrived {n} ms late"),
  mark("the robot is not connected"),
  mark("the robot has sent nothing for {n} s"),
  mark("this page only watches"),
  mark("STOP was pressed meanwhile: send it again"),
  mark("no answer within {n} s"),
  mark("no client waited for the answer"),
  mark("the robot's session ended"),
  mark("too many clients are watching this robot"),
  mark("too many of your screens are watching this robot"),
  mark("the server was blocked"),
  mark("the layout was changed"),
  mark("{name}, before a restart"),
  mark("URC, because the record of the last stop cannot be read"),
  mark("sign in, or open the address that URC printed when it started"),
  mark("screen {n}"),
  mark("screen {n} at {place}"),
  mark("somebody else"),
  mark("a screen on this machine"),
];
/** @type {Set<string>} */
const PLAIN = new Set(SENTENCES.filter((text) => !text.includes("{")));
/** @type {[string, RegExp][]} */
const FORMS = SENTENCES.filter((text) => text.includes("{")).map((text) => [text, form(text)]);

/** @param {string} text @returns {RegExp} */
function form(text) {
  const plain = text.replace(/[.*+?^$()|[\]\\]/g, "\\$&");
  const holes = plain.replace(/\{([a-z]+)\}/g, (_, name) => `(?<${name}>${name === "n" ? "[0-9.]+" : ".+"})`);
  return new RegExp(`^${holes}$`, "su");
}

/**
 * Return a message from the server in the user's language, or unchanged if it has no fixed form.
 *
 * @param {string} sentence
 * @returns {string}
 */
export function said(sentence) {
  if (PLAIN.has(sentence)) return t(sentence);
  for (const [text, pattern] of FORMS) {
    const { name, ...others } = pattern.exec(sentence)?.groups ?? {};
    if (name !== undefined) return t(text, { ...others, name: said(name) });
    if (Object.keys(others).length > 0) return t(text, others);
  }
  return sentence;
}

/**
 * Mark a text for the catalogues; `t` translates it elsewhere.
 *
 * @template {string} Text
 * @param {Text} text
 * @returns {Text}
 */
export function mark(text) {
  return text;
}
