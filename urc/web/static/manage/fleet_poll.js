// @ts-check
/**
 * The state of all robots, polled while the page is visible. One small response contains all
 * robots, and the request connects no robot.
 *
 * @typedef {import("./card_words.js").Summary} Summary
 * @typedef {{robots: Summary[], time: number, sites?: {name: string, version: string, present: boolean, fault: string}[]}} RobotList
 */
import { ask } from "../core/api_client.js";

const URL_OF_ROBOTS = "/api/v1/robots";
const EVERY_MS = 2000;
/** Interval after a failure. */
const FAILED_MS = 5000;

/**
 * Call `take` with each response, and with null after a failure. Return a function that polls at once.
 *
 * @param {(list: RobotList | null) => void} take
 */
export function followRobots(take) {
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  let isAsking = false;

  async function go() {
    clearTimeout(timer);
    if (document.hidden || isAsking) return; // `visibilitychange` polls again
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
  timer = setTimeout(go, EVERY_MS); // the page itself contains the first response
  return go;
}
