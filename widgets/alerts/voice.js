// @ts-check
/** A tone and a voice. The display never depends on them. */

const TONE_S = 0.25;

/** @type {AudioContext | null} */
let audio = null;

/** @param {boolean} isCritical whether to play two higher tones instead of one */
export function tone(isCritical) {
  try {
    audio ??= new AudioContext();
    void audio.resume();
    const start = audio.currentTime;
    for (const place of isCritical ? [0, 1] : [0]) {
      const oscillator = audio.createOscillator();
      const gain = audio.createGain();
      oscillator.frequency.value = isCritical ? 880 : 520;
      gain.gain.value = 0.2;
      oscillator.connect(gain).connect(audio.destination);
      oscillator.start(start + place * 1.5 * TONE_S);
      oscillator.stop(start + (place * 1.5 + 1) * TONE_S);
    }
  } catch (error) {
    console.info("alerts: no sound here:", error);
  }
}

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
