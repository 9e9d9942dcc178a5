// @ts-check
// A classic script, run before anything is drawn: a page that changes its colours is a page that
// blinks. The choice is kept on the device; where nothing can be kept, the device's own wish rules.
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
  // Of the document, so that a choice counts that is made while the page's modules are still coming.
  document.addEventListener("change", ({ target }) => {
    if (!(target instanceof HTMLSelectElement)) return;
    if (target.matches("[data-theme-choice]")) {
      show(target.value);
      try {
        localStorage.setItem(KEY, target.value);
      } catch {
        // Private mode: the choice lasts as long as this page.
      }
    } else if (target.matches("[data-language-choice]")) {
      // A cookie, since the server writes the page's words.
      document.cookie = `urc-language=${target.value};path=/;max-age=${YEAR_S};samesite=strict`;
      location.reload();
    }
  });
}
