// @ts-check
/**
 * The small part of a DOM that the page's own elements need: made, appended, found by simple selectors,
 * clicked. It lays nothing out; a browser's tests do that. `install()` puts it into the globals.
 */

class FakeNode {
  /** @type {FakeElement | null} */
  parentNode = null;

  get parentElement() {
    return this.parentNode;
  }

  remove() {
    if (!this.parentNode) return;
    const nodes = this.parentNode.childNodes;
    nodes.splice(nodes.indexOf(this), 1);
    this.parentNode = null;
  }
}

class FakeText extends FakeNode {
  /** @param {string} data */
  constructor(data) {
    super();
    this.data = data;
  }

  get textContent() {
    return this.data;
  }
}

/** Listeners of a document or an element. */
class Listeners {
  /** @type {Map<string, ((event: any) => void)[]>} */
  kept = new Map();

  /** @param {string} name @param {(event: any) => void} listener */
  add(name, listener) {
    this.kept.set(name, [...(this.kept.get(name) ?? []), listener]);
  }

  /** @param {string} name @param {any} event */
  call(name, event) {
    for (const listener of this.kept.get(name) ?? []) listener(event);
  }
}

export class FakeElement extends FakeNode {
  /** @param {string} tag */
  constructor(tag) {
    super();
    this.tagName = tag.toUpperCase();
    /** @type {FakeNode[]} */
    this.childNodes = [];
    /** @type {Map<string, string>} */
    this.attributes = new Map();
    this.listeners = new Listeners();
    this.value = "";
    this.style = { setProperty() {} };
    this.dataset = new Proxy(
      {},
      {
        get: (_, name) => this.getAttribute(dataName(name)) ?? undefined,
        set: (_, name, value) => (this.setAttribute(dataName(name), value), true),
        has: (_, name) => this.hasAttribute(dataName(name)),
      },
    );
  }

  /** @param {string} name */
  getAttribute(name) {
    return this.attributes.get(name) ?? null;
  }

  /** @param {string} name @param {unknown} value */
  setAttribute(name, value) {
    this.attributes.set(name, String(value));
    if (name === "value") this.value = String(value);
  }

  /** @param {string} name */
  hasAttribute(name) {
    return this.attributes.has(name);
  }

  /** @param {string} name */
  removeAttribute(name) {
    this.attributes.delete(name);
  }

  get hidden() {
    return this.hasAttribute("hidden");
  }

  set hidden(isHidden) {
    if (isHidden) this.setAttribute("hidden", "");
    else this.removeAttribute("hidden");
  }

  get className() {
    return this.getAttribute("class") ?? "";
  }

  set className(text) {
    this.setAttribute("class", text);
  }

  get children() {
    return /** @type {FakeElement[]} */ (this.childNodes.filter((one) => one instanceof FakeElement));
  }

  get childElementCount() {
    return this.children.length;
  }

  get firstChild() {
    return this.childNodes[0] ?? null;
  }

  /** @returns {string} */
  get textContent() {
    return this.childNodes.map((one) => /** @type {any} */ (one).textContent).join("");
  }

  set textContent(text) {
    this.replaceChildren(...(text ? [text] : []));
  }

  /** @param {...(FakeNode | string)} nodes */
  append(...nodes) {
    for (const one of nodes) {
      const node = typeof one === "string" ? new FakeText(one) : one;
      node.remove();
      node.parentNode = this;
      this.childNodes.push(node);
    }
  }

  /** @param {...(FakeNode | string)} nodes */
  replaceChildren(...nodes) {
    for (const one of [...this.childNodes]) one.remove();
    this.append(...nodes);
  }

  /** @param {FakeNode | null} node */
  contains(node) {
    for (let one = node; one; one = one.parentNode) if (one === this) return true;
    return false;
  }

  /** @param {string} selector @returns {FakeElement[]} */
  querySelectorAll(selector) {
    /** @type {FakeElement[]} */
    const found = [];
    for (const one of this.children) {
      if (one.matches(selector)) found.push(one);
      found.push(...one.querySelectorAll(selector));
    }
    return found;
  }

  /** @param {string} selector */
  querySelector(selector) {
    return this.querySelectorAll(selector)[0] ?? null;
  }

  /** @param {string} selector a compound of a tag, classes, attributes and `:not([attribute])` */
  matches(selector) {
    const parts = selector.match(/:not\(\[[\w-]+\]\)|\[[^\]]+\]|\.[\w-]+|^[a-z]+/g) ?? [];
    if (parts.join("") !== selector) throw new Error(`too much for this DOM: ${selector}`);
    return parts.every((part) => {
      if (part.startsWith(":not")) return !this.hasAttribute(part.slice(6, -2));
      if (part.startsWith(".")) return this.className.split(" ").includes(part.slice(1));
      if (!part.startsWith("[")) return this.tagName === part.toUpperCase();
      const [name = "", value] = part.slice(1, -1).split("=");
      return value === undefined ? this.hasAttribute(name) : this.getAttribute(name) === value.replace(/["']/g, "");
    });
  }

  /** @param {string} name @param {(event: any) => void} listener */
  addEventListener(name, listener) {
    this.listeners.add(name, listener);
  }

  /** Call the listeners of this element, then those of its ancestors. @param {string} name */
  fire(name) {
    const event = { target: this };
    for (let one = /** @type {FakeElement | null} */ (this); one; one = one.parentNode) one.listeners.call(name, event);
  }

  focus() {
    /** @type {any} */ (globalThis.document).activeElement = this;
  }

  getBoundingClientRect() {
    return { top: 0, bottom: 48, left: 0, right: 0 };
  }
}

class FakeSelect extends FakeElement {}
class FakeInput extends FakeElement {}

/** @param {string | symbol} name */
function dataName(name) {
  return `data-${String(name).replace(/[A-Z]/g, (letter) => `-${letter.toLowerCase()}`)}`;
}

/** Put the DOM into the globals, and return its body. */
export function install() {
  const body = new FakeElement("body");
  const kinds = { select: FakeSelect, input: FakeInput };
  /** @type {any} */
  const page = globalThis;
  page.Node = FakeNode;
  page.Text = FakeText;
  page.HTMLElement = FakeElement;
  page.HTMLSelectElement = FakeSelect;
  page.HTMLInputElement = FakeInput;
  page.SVGElement = class {};
  page.window = page;
  page.navigator ??= { userActivation: { hasBeenActive: false } };
  page.document = {
    title: "",
    activeElement: null,
    documentElement: new FakeElement("html"),
    createElement: (/** @type {string} */ tag) => new (/** @type {any} */ (kinds)[tag] ?? FakeElement)(tag),
    querySelector: (/** @type {string} */ selector) => body.querySelector(selector),
  };
  return body;
}
