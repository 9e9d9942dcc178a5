// @ts-check
/** Elements out of data. Text is text: nothing here reads markup. */

/**
 * @param {string} tag
 * @param {Record<string, string | boolean | (() => void)>} [is] attributes; `on…` are listeners; what
 *   is false is left out
 * @param {(Node | string | false | null | undefined)[]} inside
 * @returns {HTMLElement}
 */
export function made(tag, is = {}, ...inside) {
  const el = document.createElement(tag);
  for (const [name, value] of Object.entries(is)) {
    if (typeof value === "function") el.addEventListener(name.slice(2), value);
    else if (value === true) el.setAttribute(name, "");
    else if (value !== false && value !== "") el.setAttribute(name, value);
  }
  for (const one of inside) {
    if (one instanceof Node || typeof one === "string") el.append(one);
  }
  return el;
}

/**
 * Put rows in the place of others; who had the focus keeps it, by `data-key`.
 *
 * @param {Element} list
 * @param {HTMLElement[]} rows
 */
export function put(list, rows) {
  const held = document.activeElement;
  const key = held instanceof HTMLElement && list.contains(held) ? held.dataset["key"] : undefined;
  list.replaceChildren(...rows);
  if (!key) return;
  const again = [...list.querySelectorAll("[data-key]")].find(
    (one) => one instanceof HTMLElement && one.dataset["key"] === key,
  );
  if (again instanceof HTMLElement) again.focus();
}

/**
 * @param {string} text
 * @param {string} key
 * @param {() => void} act
 * @param {Record<string, string | boolean>} [more]
 */
export function button(text, key, act, more = {}) {
  const { class: extra = "", ...rest } = more;
  return made("button", { class: `urc-button ${extra}`.trim(), type: "button", "data-key": key, onclick: act, ...rest }, text);
}

/**
 * Let be pressed what does nothing before its module is there: a form that is sent by the browser
 * itself would be refused by the page's policy.
 *
 * @param {ParentNode} root
 */
export function ready(root) {
  for (const one of root.querySelectorAll("[data-early]")) one.removeAttribute("disabled");
}
