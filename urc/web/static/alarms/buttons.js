// @ts-check
/**
 * The page's buttons for commands, found by the configuration of their cells. An alarm presses such
 * a button instead of sending the command itself, so rights, questions and refusals stay in one place.
 * Buttons that a single tap presses have the attribute `data-presses`, with their name.
 */

/** Commands of each cell. @type {WeakMap<HTMLElement, Set<string>>} */
const KNOWN = new WeakMap();

/**
 * Return the visible button that sends a command, if it may be pressed now; otherwise null.
 *
 * @param {ParentNode} root
 * @param {string} command
 * @returns {HTMLElement | null}
 */
export function readyButton(root, command) {
  for (const button of root.querySelectorAll(".urc-cell [data-presses]")) {
    const cell = button.closest(".urc-cell");
    if (!(button instanceof HTMLElement) || !(cell instanceof HTMLElement)) continue;
    if (!commandsOf(cell).has(command)) continue;
    if (button.getAttribute("aria-disabled") !== "true" && button.checkVisibility()) return button;
  }
  return null;
}

/** @param {HTMLElement} cell */
function commandsOf(cell) {
  const known = KNOWN.get(cell);
  if (known) return known;
  /** @type {{outputs?: Record<string, {command: string}>}} */
  const { outputs = {} } = JSON.parse(cell.dataset["config"] ?? "{}");
  const commands = new Set(Object.values(outputs).map(({ command }) => command));
  KNOWN.set(cell, commands);
  return commands;
}
