// @ts-check
/**
 * The button for widgets that a small screen's grid lacks.
 *
 * The end of the grid's page number selects them. The grid's rules place the cells, and show the
 * button only on screens that lack widgets: see `urc.web.show.layout`.
 */
import { part } from "./badge.js";

const REST = "-rest";

/**
 * @param {ParentNode} root
 * @param {ParentNode} stage
 * @param {() => void} leave called before each change of the page
 * @param {AbortSignal} signal
 */
export function watchRest(root, stage, leave, signal) {
  const button = part(root, "[data-rest]");
  const grid = stage.querySelector(".urc-grid");
  if (!(grid instanceof HTMLElement)) return; // the debug interface
  const isRest = () => (grid.dataset["page"] ?? "").endsWith(REST);
  const show = () => {
    button.setAttribute("aria-pressed", String(isRest()));
    name(button);
  };
  button.addEventListener(
    "click",
    () => {
      leave();
      const number = (grid.dataset["page"] ?? "0").replace(REST, "");
      grid.dataset["page"] = isRest() ? number : number + REST;
    },
    { signal },
  );
  const changes = new MutationObserver(show); // a tab changes the page, too
  changes.observe(grid, { attributeFilter: ["data-page"] });
  signal.addEventListener("abort", () => changes.disconnect());
  addEventListener("resize", show, { signal }); // another screen may lack other widgets
  show();
}

/**
 * Name the button “Attitude +3: 4 more widgets”, because the text in the bar comes from the style sheet.
 *
 * @param {HTMLElement} button
 */
function name(button) {
  const style = getComputedStyle(button);
  const count = Number(style.getPropertyValue("--urc-rest-count"));
  button.parentElement?.toggleAttribute("data-crowded", count > 0);
  if (!count) return; // this screen has all widgets
  const { restOne = "", restMany = "" } = button.dataset;
  const seen = textOf(style.getPropertyValue("--urc-rest-first")) + textOf(style.getPropertyValue("--urc-rest-others"));
  const title = `${seen}: ${count === 1 ? restOne : restMany.replace("{count}", String(count))}`;
  button.title = title;
  button.setAttribute("aria-label", title);
}

/**
 * Return the text of a string literal of the grid's rules: without quotes and escapes.
 *
 * @param {string} literal
 */
function textOf(literal) {
  const inside = literal.trim().slice(1, -1);
  return inside.replace(/\\([0-9a-f]{1,6}) ?/gi, (_, digits) => String.fromCodePoint(parseInt(digits, 16)));
}
