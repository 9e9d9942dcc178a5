// @ts-check
/**
 * The sound of new alarms, which can be muted for a time or on this device. The list does not
 * depend on the sound.
 *
 * Browsers allow sound only after the first touch of the page.
 */

const MUTED = "urc-alarms-muted";
const TONE_S = 0.25;
/** Minimum time between two sounds; during a flood, one sound per burst is enough. */
const GAP_MS = 2000;
const FLOOD_GAP_MS = 15_000;
/** End time of an unlimited mute. */
export const ALWAYS = Number.MAX_SAFE_INTEGER;

export class AlarmSound {
  /**
   * @param {Pick<Storage, "getItem" | "setItem"> | null} storage
   * @param {(isUrgent: boolean) => void} play
   */
  constructor(storage, play = tone) {
    this.storage = storage;
    this.play = play;
    this.untilMs = this.stored();
    this.playedMs = -Infinity;
  }

  stored() {
    try {
      return Number(this.storage?.getItem(MUTED)) || 0;
    } catch {
      return 0;
    }
  }

  /**
   * @param {number} untilMs time of day; 0 ends a mute, `ALWAYS` has no end
   */
  mute(untilMs) {
    this.untilMs = untilMs;
    try {
      this.storage?.setItem(MUTED, String(untilMs));
    } catch {
      // Without storage, the mute ends with the page.
    }
  }

  /** @param {number} nowMs time of day */
  isMuted(nowMs) {
    return this.untilMs > nowMs;
  }

  /**
   * Announce new alarms, at a limited rate.
   *
   * @param {boolean} isUrgent whether one of them has high priority
   * @param {boolean} isFlooded
   * @param {number} nowMs time of day
   */
  announce(isUrgent, isFlooded, nowMs) {
    const sinceMs = nowMs - this.playedMs;
    if (this.isMuted(nowMs) || (sinceMs >= 0 && sinceMs < (isFlooded ? FLOOD_GAP_MS : GAP_MS))) return;
    this.playedMs = nowMs;
    this.play(isUrgent);
  }
}

/** @type {AudioContext | null} */
let audio = null;

/** @param {boolean} isUrgent whether to play two higher tones instead of one */
export function tone(isUrgent) {
  if (navigator.userActivation?.hasBeenActive === false) return; // the browser would refuse
  try {
    audio ??= new AudioContext();
    void audio.resume();
    const start = audio.currentTime;
    for (const place of isUrgent ? [0, 1] : [0]) {
      const oscillator = audio.createOscillator();
      const gain = audio.createGain();
      oscillator.frequency.value = isUrgent ? 880 : 520;
      gain.gain.value = 0.2;
      oscillator.connect(gain).connect(audio.destination);
      oscillator.start(start + place * 1.5 * TONE_S);
      oscillator.stop(start + (place * 1.5 + 1) * TONE_S);
    }
  } catch (error) {
    console.info("alarms: no sound here:", error);
  }
}
