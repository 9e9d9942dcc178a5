// @ts-check
/**
 * Whose a key is: an element that has the focus may need it for itself.
 */

const TEXT = [
  "textarea",
  "select",
  'input:not([type="checkbox"], [type="radio"], [type="button"], [type="range"], [type="submit"])',
  '[contenteditable]:not([contenteditable="false"])',
  '[role="textbox"]',
  '[role="searchbox"]',
].join();
const KEYS = [
  TEXT,
  'input[type="range"]',
  'input[type="radio"]',
  ...["slider", "spinbutton", "radio", "tab", "option", "listbox", "menuitem", "application", "grid"].map(
    (role) => `[role="${role}"]`,
  ),
].join();
const SPACE = [
  TEXT,
  "button",
  "summary",
  "input",
  "a[href]",
  ...["button", "switch", "checkbox", "radio", "tab", "option", "menuitem"].map((role) => `[role="${role}"]`),
].join();

/** Whether somebody types there. @param {EventTarget | null} target */
export function takesText(target) {
  return target instanceof Element && target.closest(TEXT) !== null;
}

/** Whether letters and arrows mean something there. @param {EventTarget | null} target */
export function takesKeys(target) {
  return target instanceof Element && target.closest(KEYS) !== null;
}

/** Whether Space presses what has the focus. @param {EventTarget | null} target */
export function takesSpace(target) {
  return target instanceof Element && target.closest(SPACE) !== null;
}
