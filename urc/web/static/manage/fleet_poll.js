// @ts-check
/**
 * The state of all robots, asked for while the page is visible. One small answer has all robots, and none
 * of them is connected for it.
 *
 * @typedef {import("./card_words.js").Summary} Summary
 * @typedef {{robots: Summary[], time: number}} RobotList
 */
import { ask } from "../core/api_client.js";

const URL_OF_ROBOTS = "/api/v1/robots";
const EVERY_MS = 2000;
/** Interval after a failure. */
const FAILED_MS = 5000;

/**
 * Call `take` with each answer, and with null after a failure.
 *
 * @param {(list: RobotList | null) => void} take
 */
export function followRobots(take) {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  let isAsking = false;

  async function go() {
    clearTimeout(timer);
    if (document.hidden || isAsking) return; // `visibilitychange` asks again
    isAsking = true;
    let isWell = true;
    try {
      take(await ask(URL_OF_ROBOTS));
    } catch {
      isWell = false;
      take(null);
    }
    isAsking = false;
    timer = setTimeout(go, isWell ? EVERY_MS : FAILED_MS);
  }

  document.addEventListener("visibilitychange", () => void go());
  addEventListener("online", () => void go());
  timer = setTimeout(go, EVERY_MS); // the page itself has the first answer
}
