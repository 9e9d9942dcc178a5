// @ts-check
/**
 * Small elements of the plot, and what it does with the browser.
 */

/** Milliseconds since 1970 at time 0 of the page's clock. */
export function epoch() {
  return Date.now() - performance.now();
}

/**
 * @param {string} name
 * @param {string} top
 * @param {string} [text]
 */
export function placed(name, top, text = "") {
  const made = document.createElement("div");
  made.className = name;
  made.style.top = top;
  made.textContent = text;
  return made;
}

/**
 * One signal of the legend: a button that shows or hides its line.
 *
 * @param {string} name
 * @param {string} hint
 */
export function legendItem(name, hint) {
  const item = document.createElement("li");
  const button = document.createElement("button");
  button.type = "button";
  button.className = "plot-entry";
  button.setAttribute("aria-pressed", "true");
  button.title = hint;
  for (const [part, text] of Object.entries({ swatch: "", name, value: "—" })) {
    const made = document.createElement("span");
    made.className = `plot-${part}`;
    made.textContent = text;
    button.append(made);
  }
  item.append(button);
  return { item, button };
}
