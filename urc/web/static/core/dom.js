// @ts-check
/** Creation of elements from data. Text is always plain text, never markup. */

/**
 * @param {string} tag
 * @param {Record<string, string | boolean | (() => void)>} [is] attributes; `on…` are listeners; false
 *   leaves one out
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
 * Replace the rows of a list; the focus stays on the element with the same `data-key`.
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
 * Enable the buttons of forms once their module has loaded. Before that, the browser itself would
 * submit the form, which the page policy refuses.
 *
 * @param {ParentNode} root
 */
export function ready(root) {
  for (const one of root.querySelectorAll("[data-early]")) one.removeAttribute("disabled");
}
