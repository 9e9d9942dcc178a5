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

/**
 * Let a button take the place of the link, which remains without JavaScript.
 *
 * @param {HTMLElement} place
 */
function offerRobot(place) {
  const link = place.querySelector(".urc-demo-start");
  if (!(link instanceof HTMLAnchorElement)) return;
  const button = made(link.className, link.textContent);
  button.addEventListener("click", () => drive(place, link.href));
  link.replaceWith(button);
}

/**
 * Put the playground in the place of the picture. In a frame, its style sheets and those of the site
 * do not meet, and its service worker controls it.
 *
 * @param {HTMLElement} place
 * @param {string} page
 */
function drive(place, page) {
  const frame = document.createElement("iframe");
  frame.title = "An emulated robot, and its file";
  frame.src = `${page}?embedded`;
  document.body.classList.add("urc-demo-running");
  place.replaceChildren(frame);
  place.scrollIntoView({ block: "nearest" });
  frame.focus({ preventScroll: true });
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
