// @ts-check
/**
 * The position of the sheets behind "…". On wide screens, they are next to their button. On phones,
 * the style sheet puts them at the lower edge.
 */

const GAP = 8;

/** @param {string} close name of the button that closes a sheet */
export function placeSheets(close) {
  for (const sheet of document.querySelectorAll("[data-more]")) {
    if (!(sheet instanceof HTMLElement)) continue;
    const button = document.querySelector(`[popovertarget="${CSS.escape(sheet.id)}"]`);
    sheet.append(closing(sheet, close));
    sheet.addEventListener("toggle", () => {
      if (button && sheet.matches(":popover-open")) place(sheet, button);
    });
  }
}

/**
 * @param {HTMLElement} sheet
 * @param {string} word
 */
function closing(sheet, word) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "urc-button";
  button.textContent = word;
  button.addEventListener("click", () => sheet.hidePopover());
  return button;
}

/**
 * @param {HTMLElement} sheet
 * @param {Element} button
 */
function place(sheet, button) {
  const { right, top, bottom } = button.getBoundingClientRect();
  const { width, height } = sheet.getBoundingClientRect();
  const left = Math.max(GAP, Math.min(right - width, innerWidth - width - GAP));
  const below = bottom + GAP;
  const upper = below + height > innerHeight - GAP ? Math.max(GAP, top - GAP - height) : below;
  sheet.style.setProperty("--urc-sheet-left", `${left}px`);
  sheet.style.setProperty("--urc-sheet-top", `${upper}px`);
}
