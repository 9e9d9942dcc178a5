// @ts-check
/** Spoken alarms. The display works without speech. */

/** @param {string} text */
export function say(text) {
  if (!("speechSynthesis" in globalThis)) return;
  speechSynthesis.cancel(); // the newest text replaces older ones
  const said = new SpeechSynthesisUtterance(text);
  said.lang = document.documentElement.lang;
  speechSynthesis.speak(said);
}

export function hush() {
  if ("speechSynthesis" in globalThis) speechSynthesis.cancel();
}
