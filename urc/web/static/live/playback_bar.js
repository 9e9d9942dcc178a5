// @ts-check
/**
 * The playback bar of a recording: play, pause and position.
 *
 * The server stores the position for all pages, and each page polls it. A slider drag is sent once
 * the slider rests, so that the server does not read the recording for each pixel.
 *
 * @typedef {{beganS: number, lengthS: number, positionS: number, isPlaying: boolean, speed: number}} State
 */
import { ask, reason } from "../core/api_client.js";
import { part } from "./badge.js";
import { write } from "../widgets/kit.js";
import { t } from "../core/words.js";

const EVERY_MS = 250;
/** Day and time in ISO 8601, on this device's clock. */
const WHEN = new Intl.DateTimeFormat("sv", { dateStyle: "short", timeStyle: "medium" });
/** Time for which the slider must rest before the position is sent. */
const REST_MS = 150;

const bar = part(document, "[data-tape]");
const path = bar.dataset["tape"] ?? "";
const run = /** @type {HTMLButtonElement} */ (part(bar, "[data-tape-run]"));
const place = /** @type {HTMLInputElement} */ (part(bar, "[data-tape-place]"));
const time = part(bar, "[data-tape-time]");
const note = part(bar, "[data-tape-note]");
const said = note.textContent ?? "";

let isPlaying = false;
/** Whether the operator holds the slider; then the server's position does not move it. */
let isHeld = false;
/** Number of the newest request; older responses do not count. */
let number = 0;
/** @type {number | undefined} */
let resting;

/** @param {State} state */
function show(state) {
  isPlaying = state.isPlaying;
  run.disabled = place.disabled = false;
  bar.dataset["run"] = String(isPlaying);
  run.setAttribute("aria-label", isPlaying ? t("Pause") : t("Play"));
  place.max = String(state.lengthS);
  if (!isHeld) place.value = String(state.positionS);
  const at = (state.beganS + Number(place.value)) * 1000;
  const fast = state.speed === 1 ? "" : ` · ×${state.speed}`;
  const text = `${clock(Number(place.value))} / ${clock(state.lengthS)}${fast}`;
  write(time, `${text} · ${WHEN.format(at)}`);
  place.setAttribute("aria-valuetext", text);
  write(note, state.isPlaying || state.positionS < state.lengthS ? said : t("The recording has ended."));
}

/** @param {{positionS?: number, isPlaying?: boolean}} [wish] */
async function exchange(wish) {
  number += 1;
  const mine = number;
  try {
    const state = await (wish ? ask(`${path}/move`, wish) : ask(path));
    if (mine === number) show(state);
  } catch (error) {
    if (mine === number) write(note, `◆ ${reason(error)}`);
  }
}

/** @param {number} seconds */
function clock(seconds) {
  const whole = Math.floor(seconds);
  const [hours, minutes] = [Math.floor(whole / 3600), Math.floor(whole / 60) % 60];
  const two = (/** @type {number} */ of) => String(of).padStart(2, "0");
  return hours > 0 ? `${hours}:${two(minutes)}:${two(whole % 60)}` : `${minutes}:${two(whole % 60)}`;
}

run.addEventListener("click", () => void exchange({ isPlaying: !isPlaying }));
place.addEventListener("input", () => {
  isHeld = true;
  clearTimeout(resting);
  resting = window.setTimeout(async () => {
    await exchange({ positionS: Number(place.value) });
    isHeld = false;
  }, REST_MS);
});
setInterval(() => {
  if (!document.hidden && !isHeld) void exchange();
}, EVERY_MS);
void exchange();
