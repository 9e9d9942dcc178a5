// @ts-check
/**
 * STOP for browsers without a key: one request, and its result.
 */
import { t } from "../core/words.js";

/** Time limit for the robot's acknowledgement. */
const WITHIN_MS = 5000;

/**
 * @param {HTMLButtonElement} button
 * @param {HTMLElement} note
 */
async function stop(button, note) {
  note.textContent = t("Stopping");
  try {
    const answer = await fetch(button.dataset["stopUrl"] ?? "", {
      method: "POST",
      keepalive: true,
      signal: AbortSignal.timeout(WITHIN_MS),
    });
    if (!answer.ok) throw new Error(`HTTP ${answer.status}`);
    const { confirmed } = await answer.json();
    button.dataset["phase"] = confirmed ? "confirmed" : "latched";
    note.textContent = confirmed ? t("Stopped: the robot has confirmed it") : t("Stop is kept; the robot has not confirmed it");
  } catch (error) {
    console.warn("URC: STOP could not be delivered:", error);
    button.dataset["phase"] = "fault";
    note.textContent = t("NO LINK: STOP was not delivered");
  }
}

for (const button of document.querySelectorAll("[data-stop-url]")) {
  const note = button.nextElementSibling;
  if (!(button instanceof HTMLButtonElement) || !(note instanceof HTMLElement)) continue;
  button.addEventListener("pointerdown", () => void stop(button, note));
  button.addEventListener("keydown", (event) => {
    if (event.repeat || (event.key !== "Enter" && event.code !== "Space")) return;
    event.preventDefault();
    void stop(button, note);
  });
  // Screen readers send a click without pointer events.
  button.addEventListener("click", (event) => {
    if (event.detail === 0) void stop(button, note);
  });
}
