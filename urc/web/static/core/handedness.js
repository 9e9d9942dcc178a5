// @ts-check
// A classic script before the first paint, so that the grid does not jump. The device stores the
// operator's hand; the grid's rules have a layout for each hand.
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

  const showChoice = () => {
    for (const choice of document.querySelectorAll("[data-hand-choice]")) {
      if (choice instanceof HTMLInputElement) choice.checked = choice.value === kept();
    }
  };

  show(kept());
  // The playground runs this script in a document that is already complete.
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", showChoice);
  else showChoice();
  document.addEventListener("change", ({ target }) => {
    if (!(target instanceof HTMLInputElement) || !target.matches("[data-hand-choice]")) return;
    // Release held controls before they move away from the finger.
    dispatchEvent(new CustomEvent("urc-let-go", { detail: "the layout was changed" }));
    show(target.value);
    try {
      localStorage.setItem(KEY, target.value);
    } catch {
      // In private mode, the choice lasts until the page closes.
    }
  });
}
