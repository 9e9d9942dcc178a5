// @ts-check
// STOP before the modules of a page have loaded, and on a page without modules.
//
// This classic script in the head runs before the browser shows the first button. It handles each
// button with `data-early-stop`, and Escape on the page of a robot. A module that arms a button
// removes the attribute. The element around the button has the URL in `data-stop` and the texts for
// each phase in `data-stop-words`. A module that listens to `urc-early-stop` on that element takes
// over the press.
{
  /** Time limit for the robot's acknowledgement. */
  const WITHIN_MS = 5000;

  /**
   * @param {Element} button
   * @param {HTMLElement} place
   * @param {"sending" | "latched" | "confirmed" | "fault"} phase
   */
  const show = (button, place, phase) => {
    place.dataset["stopSent"] = phase;
    if (!button.hasAttribute("data-early-stop")) return; // its module shows the state
    button.setAttribute("data-phase", phase);
    const note = button.nextElementSibling;
    if (note) note.textContent = JSON.parse(place.dataset["stopWords"] ?? "{}")[phase] ?? "";
  };

  /** @param {Element} button */
  const press = async (button) => {
    const place = button.closest("[data-stop]");
    if (!(place instanceof HTMLElement)) return;
    if (!place.dispatchEvent(new Event("urc-early-stop", { cancelable: true }))) return;
    show(button, place, "sending");
    try {
      const answer = await fetch(place.dataset["stop"] ?? "", {
        method: "POST",
        keepalive: true,
        signal: AbortSignal.timeout(WITHIN_MS),
      });
      if (!answer.ok) throw new Error(`HTTP ${answer.status}`);
      show(button, place, (await answer.json()).confirmed ? "confirmed" : "latched");
    } catch (error) {
      if (place.dataset["stopSent"] === "taken") return; // the modules have repeated it
      console.warn("URC: STOP could not be delivered:", error);
      show(button, place, "fault");
      // The modules may have started meanwhile. If so, they repeat the press.
      place.dispatchEvent(new Event("urc-early-stop", { cancelable: true }));
    }
  };

  /** @param {Event} event @returns {Element | undefined} */
  const pressed = (event) =>
    event.target instanceof Element ? (event.target.closest("[data-early-stop]") ?? undefined) : undefined;

  /** The pointer whose touch has already acted; its click is the same press. */
  let counted = NaN;
  document.addEventListener("pointerdown", (event) => {
    const button = event.button === 0 ? pressed(event) : undefined;
    if (!button) return;
    counted = event.pointerId;
    void press(button);
  });
  document.addEventListener("click", (event) => {
    const button = pressed(event);
    const isSame = event instanceof PointerEvent && event.pointerId === counted;
    counted = NaN;
    if (button && !isSame) void press(button);
  });
  document.addEventListener("keydown", (event) => {
    if (event.key !== "Escape" || event.repeat || event.defaultPrevented) return;
    if (document.querySelector(":popover-open")) return; // Escape closes the popover
    const button = document.querySelector("[data-robot] [data-stop-button][data-early-stop]");
    if (button) void press(button);
  });
}
