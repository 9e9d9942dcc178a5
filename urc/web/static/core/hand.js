// @ts-check
// A classic script, run before anything is drawn: a grid that turns round is a grid that jumps. With
// which hand the operator works is kept on the device; the rules of the grid know both.
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
        // Whoever holds a control lets go of it before it moves away under the finger.
        dispatchEvent(new CustomEvent("urc-let-go", { detail: "the layout was changed" }));
        show(choice.value);
        try {
          localStorage.setItem(KEY, choice.value);
        } catch {
          // Private mode: the choice lasts as long as this page.
        }
      });
    }
  });
}
