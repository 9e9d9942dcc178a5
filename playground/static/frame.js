// @ts-check
/**
 * Fills the frame with the robot's page, as the worker renders it. A classic script: the page's import
 * map must come before any module.
 *
 * The document keeps its root element. Chromium 156 refuses the capture of a pointer in a document whose
 * root was replaced after it had loaded, also by `document.open`: no stick could be held.
 */
void (async () => {
  const host = /** @type {any} */ (window.parent).urcPlayground;
  if (window.parent === window || !host) return;
  const html = await host.page(location.search.slice(1));
  const page = new DOMParser().parseFromString(html, "text/html");
  copyAttributes(page.documentElement, document.documentElement);
  copyAttributes(page.body, document.body);
  document.body.replaceChildren(...page.body.childNodes);
  document.head.replaceChildren(...page.head.childNodes);
  for (const script of document.querySelectorAll("script")) script.replaceWith(running(script));
})();

/**
 * Return a script that runs once it is in the document, in the order of the document: parsed ones never
 * run.
 *
 * @param {HTMLScriptElement} parsed
 */
function running(parsed) {
  const script = document.createElement("script");
  copyAttributes(parsed, script);
  script.nonce = parsed.nonce; // a document may hide it from the attributes
  script.async = false;
  script.textContent = parsed.textContent;
  return script;
}

/**
 * @param {Element} from
 * @param {Element} to
 */
function copyAttributes(from, to) {
  for (const { name, value } of from.attributes) to.setAttribute(name, value);
}
