// @ts-check
/**
 * A reader of XML text. The page policy forbids the browser's own parser for text that does not come
 * from a file of the server. Only what models of robots need: elements, attributes and comments; text
 * between elements is left out. Pure, except for `documentOf`.
 *
 * @typedef {{name: string, attributes: [string, string][], children: Element[]}} Element
 */

const MOST_LETTERS = 8_000_000;
const MOST_ELEMENTS = 50_000;
const DEEPEST = 100;
const NAME = "[A-Za-z_:][\\w:.\\-]*";
const TOKEN = new RegExp(
  [
    "<!--[^]*?-->", "<\\?[^]*?\\?>", "<!\\[CDATA\\[[^]*?\\]\\]>",
    `<(/?)(${NAME})((?:\\s+${NAME}\\s*=\\s*(?:"[^"<]*"|'[^'<]*'))*)\\s*(/?)>`,
  ].join("|"),
  "y",
);
const ATTRIBUTE = new RegExp(`(${NAME})\\s*=\\s*(?:"([^"]*)"|'([^']*)')`, "g");
const ENTITIES = new Map([["amp", "&"], ["lt", "<"], ["gt", ">"], ["quot", '"'], ["apos", "'"]]);

/**
 * Return the root element of a text; throw an error if it is no XML.
 *
 * @param {string} text
 * @returns {Element}
 */
export function parseXml(text) {
  if (text.length > MOST_LETTERS) throw new Error("the model is too large");
  /** @type {Element} */
  const top = { name: "", attributes: [], children: [] };
  const open = [top];
  let count = 0;
  for (let at = text.indexOf("<"); at >= 0; at = text.indexOf("<", at)) {
    TOKEN.lastIndex = at;
    const found = TOKEN.exec(text);
    if (!found) throw new Error("the model is no XML");
    at = TOKEN.lastIndex;
    const [, slash, name, attributes = "", end] = found;
    if (name === undefined) continue; // a comment, a declaration or text
    if (slash) {
      if (open.length < 2 || open.pop()?.name !== name) throw new Error("the model is no XML");
      continue;
    }
    count += 1;
    if (count > MOST_ELEMENTS || open.length > DEEPEST) throw new Error("the model is too large");
    /** @type {Element} */
    const made = { name, attributes: attributesOf(attributes), children: [] };
    open.at(-1)?.children.push(made);
    if (!end) open.push(made);
  }
  const [root, ...others] = top.children;
  if (!root || others.length > 0 || open.length > 1) throw new Error("the model is no XML");
  return root;
}

/**
 * @param {string} text
 * @returns {[string, string][]}
 */
function attributesOf(text) {
  return [...text.matchAll(ATTRIBUTE)].map(([, name = "", one, other]) => [name, plain(one ?? other ?? "")]);
}

/** Replace the entities in a text. @param {string} text */
function plain(text) {
  return text.replace(/&(#x[0-9a-f]{1,6}|#\d{1,7}|\w{1,8});/gi, (whole, /** @type {string} */ name) => {
    if (!name.startsWith("#")) return ENTITIES.get(name) ?? whole;
    const code = /^#x/i.test(name) ? Number.parseInt(name.slice(2), 16) : Number.parseInt(name.slice(1), 10);
    return code <= 0x10ffff ? String.fromCodePoint(code) : whole;
  });
}

/**
 * Return the document of a text; throw an error if it is no XML.
 *
 * @param {string} text
 */
export function documentOf(text) {
  const root = parseXml(text);
  const made = document.implementation.createDocument(null, null);
  const build = (/** @type {Element} */ { name, attributes, children }) => {
    const element = made.createElementNS(null, name.replaceAll(":", "_"));
    for (const [key, value] of attributes) element.setAttribute(key.replaceAll(":", "_"), value);
    for (const child of children) element.append(build(child));
    return element;
  };
  made.append(build(root));
  return made;
}
