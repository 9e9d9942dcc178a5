// @ts-check
/**
 * Style sheets of third-party modules, found by module name in the import map and loaded once.
 */

/** @type {Map<string, Promise<void>>} */
const loaded = new Map();

/**
 * Load the style sheet of a module, below the widgets' own styles, which may override it.
 *
 * @param {string} module name in the import map
 * @returns {Promise<void>}
 */
export function loadStyle(module) {
  const known = loaded.get(module);
  if (known) return known;
  const loading = load(module);
  loaded.set(module, loading);
  loading.catch(() => loaded.delete(module));
  return loading;
}

/** @param {string} module */
async function load(module) {
  const url = import.meta.resolve(`${module}/style.css`); // throws if the map has none
  const el = document.createElement("style");
  // A linked sheet would be above every layer, and therefore above the widgets' styles.
  const script = document.querySelector("script[nonce]");
  el.nonce = script instanceof HTMLScriptElement ? script.nonce : "";
  el.textContent = `@import url(${JSON.stringify(url)}) layer(widgets.vendor);`;
  await new Promise((resolve, reject) => {
    el.addEventListener("load", resolve);
    el.addEventListener("error", () => reject(new Error(`the style sheet of ${module} did not load`)));
    document.head.append(el);
  });
}
