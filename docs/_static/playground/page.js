// @ts-check
/**
 * “Check” at every document of the site, and the robot on the front page. Nothing is loaded before a
 * click.
 */

const root = new URL(document.documentElement.dataset["content_root"] ?? "./", location.href);
const playground = new URL("playground/", root);

for (const block of document.querySelectorAll(".urc-document")) {
  if (block instanceof HTMLElement) offerCheck(block);
}
for (const place of document.querySelectorAll(".urc-demo")) {
  if (place instanceof HTMLElement) offerRobot(place);
}

/** @param {HTMLElement} block */
function offerCheck(block) {
  const button = made("urc-check", "Check");
  block.append(button);
  button.addEventListener("click", async () => {
    button.disabled = true;
    try {
      await style("editor.css");
      const { Editor } = await import(new URL("editor.js", playground).href);
      const text = block.querySelector("pre")?.textContent ?? "";
      const el = document.createElement("div");
      block.replaceChildren(el);
      const editor = new Editor(el, { text, label: "Document in YAML", page: playground.href });
      editor.area.focus({ preventScroll: true });
      void editor.check();
    } catch (error) {
      button.disabled = false;
      button.textContent = `Not loaded: ${error instanceof Error ? error.message : error}`;
    }
  });
}

/** @param {HTMLElement} place */
function offerRobot(place) {
  const link = document.createElement("a");
  link.className = "urc-check urc-demo-start";
  link.href = playground.href;
  link.textContent = "Drive it in this browser";
  place.append(link);
}

/**
 * @param {string} name
 * @param {string} text
 */
function made(name, text) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = name;
  button.textContent = text;
  return button;
}

/** @param {string} name */
function style(name) {
  const href = new URL(name, playground).href;
  if (document.querySelector(`link[href="${href}"]`)) return Promise.resolve();
  const link = document.createElement("link");
  link.rel = "stylesheet";
  link.href = href;
  document.head.append(link);
  return new Promise((resolve, reject) => {
    link.addEventListener("load", resolve);
    link.addEventListener("error", () => reject(new Error(name)));
  });
}
