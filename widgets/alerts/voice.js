// @ts-check
/** A voice. The display never depends on it. */

/** @param {string} text */
export function say(text) {
  if (!("speechSynthesis" in globalThis)) return;
  speechSynthesis.cancel(); // the newest text wins
  const said = new SpeechSynthesisUtterance(text);
  said.lang = document.documentElement.lang;
  speechSynthesis.speak(said);
}

export function hush() {
  if ("speechSynthesis" in globalThis) speechSynthesis.cancel();
}
