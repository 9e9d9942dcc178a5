// @ts-check
/**
 * The card in the middle of the page of a robot that cannot be reached: cause, next step, and buttons.
 * Meanwhile the widgets keep quiet: the card says it once for all of them.
 *
 * @typedef {import("../core/types.js").Link} Link
 * @typedef {import("./store.js").Store} Store
 */
import { part } from "./badge.js";
import { causeWords } from "../core/connection_causes.js";
import { said, t } from "../core/words.js";

/** Time after the loss of a good connection until the card covers the page. */
const GRACE_MS = 3000;
/** Time for which "Try now" stays disabled. */
const TRYING_MS = 1500;

export class LostCard {
  /**
   * @param {HTMLElement} el the card
   * @param {HTMLElement} root the page of the robot
   * @param {() => void} tryNow
   */
  constructor(el, root, tryNow) {
    this.el = el;
    this.root = root;
    this.title = part(el, "[data-lost-title]");
    this.cause = part(el, "[data-lost-cause]");
    this.step = part(el, "[data-lost-step]");
    this.again = part(el, "[data-lost-again]");
    this.shown = "";
    /** Whether a connection was good since the page was opened. */
    this.wasGood = false;
    /** Time of the present loss; 0 without one. */
    this.lostMs = 0;
    this.again.addEventListener("click", () => {
      tryNow();
      this.again.setAttribute("disabled", "");
      setTimeout(() => this.again.removeAttribute("disabled"), TRYING_MS);
    });
  }

  /**
   * @param {Store} store
   * @param {import("./socket.js").Socket} socket
   * @param {number} nowMs
   */
  frame(store, socket, nowMs) {
    const loss = lossOf(store, socket);
    if (!loss) this.wasGood ||= store.isUp && [...store.links.values()].some(isConnected);
    if (!loss) this.lostMs = 0;
    else if (this.lostMs === 0) this.lostMs = nowMs;
    const isShown = loss !== null && (!this.wasGood || nowMs - this.lostMs >= GRACE_MS);
    const key = isShown ? JSON.stringify(loss) : "";
    if (key === this.shown) return;
    this.shown = key;
    this.el.hidden = !isShown;
    this.root.toggleAttribute("data-robot-lost", isShown);
    if (loss && isShown) this.say(loss);
  }

  /** @param {Loss} loss */
  say(loss) {
    const robot = this.el.dataset["robot"] ?? "";
    const { cause, step, isForeign } =
      loss.of === "robot"
        ? causeWords(loss.cause, loss.address, loss.detail)
        : { cause: said(loss.detail), step: t("Is the server running? Is this device on its network?"), isForeign: false };
    this.title.textContent =
      loss.of === "robot" ? t("Cannot reach {title}", { title: robot }) : t("No connection to URC");
    this.cause.textContent = cause;
    this.cause.lang = isForeign ? "en" : "";
    const hint = loss.of === "robot" ? this.hint(loss.transport) : "";
    this.step.textContent = hint || step;
  }

  /** Return the driver's own next step for a transport. @param {string} transport */
  hint(transport) {
    const hints = JSON.parse(this.el.dataset["hints"] ?? "{}");
    return Object.hasOwn(hints, transport) ? String(hints[transport]) : "";
  }
}

/**
 * @typedef {{of: "robot", transport: string, cause: string, address: string, detail: string}} RobotLoss
 * @typedef {{of: "server", detail: string}} ServerLoss
 * @typedef {RobotLoss | ServerLoss} Loss
 */

/**
 * Return what is lost: the server, or the whole robot. A robot with one good connection is not lost.
 *
 * @param {Store} store
 * @param {import("./socket.js").Socket} socket
 * @returns {Loss | null}
 */
export function lossOf(store, socket) {
  if (!store.isUp) {
    if (socket.failures === 0 || socket.isShutOut) return null;
    return { of: "server", detail: socket.reason };
  }
  const links = [...store.links.values()];
  const lost = links.find(({ state }) => state === "lost");
  if (!lost || links.some(isConnected)) return null;
  const { transport, cause, address, detail } = lost;
  return { of: "robot", transport, cause, address, detail };
}

/** @param {Link} link */
function isConnected({ state }) {
  return state === "live" || state === "silent";
}
