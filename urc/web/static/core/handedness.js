// @ts-check
// A classic script before the first paint, so that the grid does not jump. The device stores the
// operator's hand; the rules of the grid have a layout for each.
{
  const KEY = "urc-hand";

  /** @returns {string} */
  const kept = () => {
    try {
      return localStorage.getItem(KEY) === "left" ? "left" : "";
    } catch {
      return "";
    }
  };

  /** @param {string} hand */
  const show = (hand) => {
    if (hand) document.documentElement.dataset["hand"] = hand;
    else delete document.documentElement.dataset["hand"];
  };

  show(kept());
  document.addEventListener("DOMContentLoaded", () => {
    for (const choice of document.querySelectorAll("select[data-hand-choice]")) {
      if (!(choice instanceof HTMLSelectElement)) continue;
      choice.value = kept();
      choice.addEventListener("change", () => {
        // Held controls are released before they move away under the finger.
        dispatchEvent(new CustomEvent("urc-let-go", { detail: "the layout was changed" }));
        show(choice.value);
        try {
          localStorage.setItem(KEY, choice.value);
        } catch {
          // Private mode: the choice lasts until the page closes.
        }
      });
    }
  });
}
