// @ts-check
/**
 * The arguments of a command as a form, for the developer page and the debug interface.
 *
 * @typedef {import("../core/types.js").Value} Value
 *
 * @typedef {object} Argument
 * @property {string} name
 * @property {string} type
 * @property {string} items
 * @property {string} title
 * @property {string} unit
 * @property {number | null} min
 * @property {number | null} max
 * @property {Value[]} choices
 * @property {unknown} default
 * @property {boolean} required
 *
 * @typedef {object} Field
 * @property {Argument} argument
 * @property {HTMLElement} label
 * @property {() => unknown} read the input as its type; undefined for an empty field
 */
import { element } from "./bytes.js";

/**
 * @param {string} text
 * @param {"submit" | "button"} type
 */
export function button(text, type) {
  const el = document.createElement("button");
  el.className = "urc-button";
  el.type = type;
  el.textContent = text;
  return el;
}

/**
 * @param {Argument} argument
 * @returns {Field}
 */
export function field(argument) {
  const label = element("label", "dev-field");
  label.append(caption(argument));
  const choices = argument.type === "boolean" ? [true, false] : argument.choices;
  if (choices.length > 0 && argument.type !== "array") {
    const select = document.createElement("select");
    select.className = "dev-input";
    if (!argument.required) select.append(new Option(`default: ${String(argument.default)}`, ""));
    choices.forEach((choice, place) => select.append(new Option(String(choice), String(place))));
    label.append(select);
    return { argument, label, read: () => (select.value === "" ? undefined : choices[Number(select.value)]) };
  }
  const input = document.createElement("input");
  input.className = "dev-input";
  input.autocomplete = "off";
  input.spellcheck = false;
  if (argument.type === "number" || argument.type === "integer") input.inputMode = "decimal";
  if (argument.default !== null) input.placeholder = JSON.stringify(argument.default);
  if (argument.type === "array") input.placeholder ||= "[1, 2, 3]";
  label.append(input);
  return { argument, label, read: () => typed(argument, input.value) };
}

/**
 * Return the values of the fields by the names of the arguments, without empty fields.
 *
 * @param {Field[]} fields
 */
export function valuesOf(fields) {
  /** @type {Record<string, any>} */
  const values = {};
  for (const { argument, read } of fields) {
    const value = read();
    if (value !== undefined) values[argument.name] = value;
  }
  return values;
}

/** @param {Argument} argument */
function caption(argument) {
  const { min, max } = argument;
  const range = min !== null && max !== null ? `${min} to ${max}` : min !== null ? `from ${min}` : max !== null ? `to ${max}` : "";
  const kind = argument.type === "array" ? `list of ${argument.items}` : argument.type;
  const words = [kind, range, argument.unit, argument.required ? "" : "optional"].filter(Boolean);
  return `${argument.name} (${words.join(", ")})`;
}

/**
 * Return the input as its type; invalid input is sent unchanged, and the server reports it.
 *
 * @param {Argument} argument
 * @param {string} text
 */
function typed(argument, text) {
  if (text === "" && (argument.type !== "string" || !argument.required)) return undefined;
  if (argument.type === "string") return text;
  if (argument.type === "array") {
    try {
      return JSON.parse(text.trim().startsWith("[") ? text : `[${text}]`);
    } catch {
      return text;
    }
  }
  const number = Number(text);
  return text.trim() !== "" && Number.isFinite(number) ? number : text;
}
