// @ts-check
// A classic script before the first paint, so that colours do not flash. The device stores the choice;
// without storage, the preference of the system counts.
{
  const KEY = "urc-theme";
  const THEMES = new Set(["dark", "light", "sunlight", "night"]);

  /** @returns {string} */
  const kept = () => {
    try {
      return localStorage.getItem(KEY) ?? "";
    } catch {
      return "";
    }
  };

  /** @param {string} name */
  const show = (name) => {
    if (THEMES.has(name)) document.documentElement.dataset["theme"] = name;
    else delete document.documentElement.dataset["theme"];
  };

  const YEAR_S = 365 * 24 * 3600;

  show(kept());
  document.addEventListener("DOMContentLoaded", () => {
    for (const choice of document.querySelectorAll("select[data-theme-choice]")) {
      if (!(choice instanceof HTMLSelectElement)) continue;
      choice.value = THEMES.has(kept()) ? kept() : "";
    }
  });
  // On the document, so that a choice before the modules have loaded counts.
  document.addEventListener("change", ({ target }) => {
    if (!(target instanceof HTMLSelectElement)) return;
    if (target.matches("[data-theme-choice]")) {
      show(target.value);
      try {
        localStorage.setItem(KEY, target.value);
      } catch {
        // Private mode: the choice lasts until the page closes.
      }
    } else if (target.matches("[data-language-choice]")) {
      // A cookie, since the server renders the texts of the page.
      document.cookie = `urc-language=${target.value};path=/;max-age=${YEAR_S};samesite=strict`;
      location.reload();
    }
  });
}
