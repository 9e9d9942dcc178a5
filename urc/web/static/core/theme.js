// @ts-check
// A classic script before the first paint, so that colours do not flash. The device stores the
// choice; without storage, the system's preference applies.
{
  const KEY = "urc-theme";
  const UNITS_KEY = "urc-units"; // the same as in units.js
  const NAME_KEY = "urc-screen-name";
  const THEMES = new Set(["dark", "light", "sunlight", "night"]);

  /** @param {string} key @returns {string} */
  const kept = (key) => {
    try {
      return localStorage.getItem(key) ?? "";
    } catch {
      return "";
    }
  };

  /** @param {string} key @param {string} value */
  const keep = (key, value) => {
    try {
      localStorage.setItem(key, value);
    } catch {
      // In private mode, the choice lasts until the page closes.
    }
  };

  /** @param {string} name */
  const show = (name) => {
    if (THEMES.has(name)) document.documentElement.dataset["theme"] = name;
    else delete document.documentElement.dataset["theme"];
  };

  const YEAR_S = 365 * 24 * 3600;

  const showChoices = () => {
    const theme = THEMES.has(kept(KEY)) ? kept(KEY) : "";
    for (const choice of document.querySelectorAll("[data-theme-choice]")) {
      if (choice instanceof HTMLInputElement) choice.checked = choice.value === theme;
    }
    for (const choice of document.querySelectorAll("select[data-units-choice]")) {
      if (!(choice instanceof HTMLSelectElement)) continue;
      choice.value = kept(UNITS_KEY);
      if (choice.selectedIndex < 0) choice.value = "";
    }
    for (const field of document.querySelectorAll("[data-screen-name]")) {
      if (field instanceof HTMLInputElement) field.value = kept(NAME_KEY);
    }
  };

  show(kept(KEY));
  // The playground runs this script in a document that is already complete.
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", showChoices);
  else showChoices();
  // On the document, so that a choice counts even before the modules have loaded.
  document.addEventListener("change", ({ target }) => {
    if (target instanceof HTMLInputElement && target.matches("[data-theme-choice]")) {
      show(target.value);
      keep(KEY, target.value);
    }
    if (target instanceof HTMLInputElement && target.matches("[data-screen-name]")) keep(NAME_KEY, target.value.trim());
    if (!(target instanceof HTMLSelectElement)) return;
    if (target.matches("[data-units-choice]")) keep(UNITS_KEY, target.value);
    if (target.matches("[data-language-choice]")) {
      // A cookie, because the server renders the texts of the page.
      document.cookie = `urc-language=${target.value};path=/;max-age=${YEAR_S};samesite=strict`;
      location.reload();
    }
  });
}
