// @ts-check
/**
 * Key ownership: whether the focused element needs a key for itself.
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

/** Whether the element accepts text. @param {EventTarget | null} target */
export function takesText(target) {
  return target instanceof Element && target.closest(TEXT) !== null;
}

/** Whether the element uses letters and arrows. @param {EventTarget | null} target */
export function takesKeys(target) {
  return target instanceof Element && target.closest(KEYS) !== null;
}

/** Whether Space presses the focused element. @param {EventTarget | null} target */
export function takesSpace(target) {
  return target instanceof Element && target.closest(SPACE) !== null;
}
