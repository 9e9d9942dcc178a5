// @ts-check
/**
 * The link badge: the links' state in one word, and the round-trip time.
 *
 * @typedef {import("../core/types.js").Link} Link
 * @typedef {import("./store.js").Store} Store
 * @typedef {import("./socket.js").Socket} Socket
 * @typedef {"good" | "connecting" | "caution" | "bad" | "replay"} Sign
 */

import { write } from "../widgets/kit.js";
import { t } from "../core/words.js";

const CAUTION_MS = 100;
const POOR_MS = 250;
/** Times from here on are shown in seconds, because more digits would be too wide. */
const SECONDS_FROM_MS = 2000;
/** Link states from worst to best; the worst link determines the badge. @type {Link["state"][]} */
const WORST_FIRST = ["lost", "silent", "connecting", "idle", "live"];

export class Badge {
  /** @param {HTMLElement} el */
  constructor(el) {
    this.el = el;
    this.text = part(el, "[data-badge-text]");
    this.trip = part(el, "[data-badge-trip]");
    this.isReplay = "replay" in el.dataset;
  }

  /**
   * @param {Store} store
   * @param {Socket} socket
   */
  frame(store, socket) {
    let [sign, text] = summary(store, socket);
    // A playback is never live.
    if (this.isReplay && sign === "good") [sign, text] = ["replay", t("Replay")];
    if (this.el.dataset["state"] !== sign) this.el.dataset["state"] = sign;
    write(this.text, text);
    // Next to “Robot lost”, a short delay to URC would look like a good connection.
    const [quality, figure] = tripOf(sign === "bad" ? null : socket.tripMs);
    if (this.trip.dataset["trip"] !== quality) this.trip.dataset["trip"] = quality;
    write(this.trip, figure);
  }
}

/**
 * @param {Store} store
 * @param {Socket} socket
 * @returns {[Sign, string]}
 */
function summary(store, socket) {
  if (!store.isUp) {
    if (socket.failures === 0) return ["connecting", t("Connecting")];
    return ["bad", socket.refusal ? t("Cannot open") : t("No connection to URC")];
  }
  const links = [...store.links.values()];
  const worst = WORST_FIRST.find((state) => links.some((link) => link.state === state));
  const name = links.length > 1 ? links.find((link) => link.state === worst)?.transport : t("Robot");
  switch (worst) {
    case "lost":
      // A robot that was never reached is not lost.
      return ["bad", store.wasLive ? t("{name} lost", { name: name ?? "" }) : t("Not connected")];
    case "silent":
      return ["caution", t("{name} silent", { name: name ?? "" })];
    case "live":
      return ["good", t("Live")];
    case "idle":
    case "connecting":
    case undefined:
      return ["connecting", t("Connecting")];
  }
}

/**
 * @param {number | null} tripMs
 * @returns {[string, string]} quality and text
 */
function tripOf(tripMs) {
  if (tripMs === null) return ["", ""];
  const figure = tripMs < SECONDS_FROM_MS ? `${Math.max(1, Math.round(tripMs))} ms` : `${Math.round(tripMs / 1000)} s`;
  if (tripMs > POOR_MS) return ["bad", t("late {time}", { time: figure })];
  if (tripMs > CAUTION_MS) return ["caution", t("late {time}", { time: figure })];
  return ["good", figure];
}

/**
 * @param {ParentNode} root
 * @param {string} selector
 * @returns {HTMLElement}
 */
export function part(root, selector) {
  const found = root.querySelector(selector);
  if (!(found instanceof HTMLElement)) throw new Error(`the page has no ${selector}`);
  return found;
}
