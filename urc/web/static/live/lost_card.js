// @ts-check
/**
 * The card above STOP (or at the top, if it hides fewer values there) on the page of an unreachable
 * robot, with the cause, a hint, buttons, and the age of the background. Meanwhile, the widgets show no messages, because the card replaces them.
 * They keep their last values, with their ages.
 *
 * @typedef {import("../core/types.js").Link} Link
 * @typedef {import("./store.js").Store} Store
 */
import { part } from "./badge.js";
import { attemptsText, causeWords, lostForText, stepOf } from "../core/connection_causes.js";
import { said, t } from "../core/words.js";

/** Time from the loss of a good connection until the card covers the page. */
const GRACE_MS = 3000;
/** Time from which the page says that it waits for the first connection. */
const SHORT_MS = 700;
/** Time for which "Try now" stays disabled. */
const TRYING_MS = 1500;

/** Distance between the card and what stays in sight, in pixels. */
const GAP_PX = 8;
/** Cells in front of the background that only show something large. */
const VIEWS = '.urc-grid > .urc-cell[data-footprint="view"]:not([data-place="ground"])';
/** Cells that do nothing while the robot is lost. */
const CONTROLS = `.urc-grid > .urc-cell:is([data-footprint="stick"], [data-footprint="lever"], [data-footprint="button"])`;
/** Cells that the card never covers: values, STOP, and a control in use. */
const KEPT = `.urc-grid > .urc-cell:not([data-footprint="stick"], [data-footprint="lever"], [data-footprint="button"], [data-footprint="view"]), .urc-grid > .urc-cell:is(.urc-asking, :focus-within, :has(> .stop)):not([data-footprint="view"])`;

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
    this.tries = part(el, "[data-lost-tries]");
    this.again = part(el, "[data-lost-again]");
    this.age = part(el, "[data-lost-age]");
    this.shown = "";
    /** Height of what stays in sight between the card and STOP. */
    this.footPx = 0;
    /** Transports that only commands open. @type {string[]} */
    this.onDemand = JSON.parse(el.dataset["onDemand"] ?? "[]");
    /** Whether any connection has been good since the page was opened. */
    this.wasGood = false;
    /** Time since which the page waits for the first connection; infinite otherwise. */
    this.connectingMs = Infinity;
    /** Time of the current loss; 0 without a loss. */
    this.lostMs = 0;
    /** Kind of the current loss, and the time since which it is of this kind. @type {Loss["of"] | undefined} */
    this.lostOf = undefined;
    this.kindMs = 0;
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
   * @param {boolean} isReplay whether a recording plays, which cannot lose a robot
   */
  frame(store, socket, nowMs, isReplay) {
    const found = lossOf(store, socket, this.onDemand);
    const loss = isReplay && found?.of === "robot" ? null : found;
    if (!loss) this.wasGood ||= store.isUp && [...store.links.values()].some(isConnected);
    if (!loss) this.lostMs = 0;
    else if (this.lostMs === 0) this.lostMs = nowMs;
    if (loss?.of !== this.lostOf) this.kindMs = nowMs;
    this.lostOf = loss?.of;
    const isConnecting = !loss && !isReplay && !this.wasGood && waitsIn(store, this.onDemand);
    if (!isConnecting) this.connectingMs = Infinity;
    else if (this.connectingMs === Infinity) this.connectingMs = nowMs;
    this.root.toggleAttribute("data-robot-connecting", nowMs - this.connectingMs >= SHORT_MS);
    const isShown = loss !== null && (!this.wasGood || nowMs - this.lostMs >= GRACE_MS);
    const tries = isShown ? triesWords(loss, store, this.kindMs, nowMs) : "";
    if (this.tries.textContent !== tries) this.tries.textContent = tries;
    const ground = this.root.querySelector('[data-place="ground"]');
    const age = isShown ? lastWords(ground) || emptyWords(ground) : "";
    if (this.age.textContent !== age) this.age.textContent = age;
    if (isShown && !this.el.hidden) this.place();
    const key = isShown ? JSON.stringify(loss) : "";
    if (key === this.shown) return;
    this.shown = key;
    this.el.hidden = !isShown;
    this.root.toggleAttribute("data-robot-lost", isShown);
    if (loss && isShown) this.say(loss);
  }

  /**
   * Put the card in the place of the controls on a phone in portrait. Elsewhere, put it at the top of the page if it covers fewer old values there than above STOP. Views
   * do not count, because the background at the top is one of them.
   */
  place() {
    this.placeBox();
    const card = boxOf(part(this.el, ".urc-lost-card"));
    const controls = [...this.root.querySelectorAll(CONTROLS)].map(boxOf);
    const isOver = (/** @type {DOMRect} */ one) =>
      one.width > 0 && one.left < card.right && one.right > card.left && one.top < card.bottom && one.bottom > card.top;
    this.root.toggleAttribute("data-lost-over", controls.some(isOver));
  }

  /** Put the card into the background without a picture, if the background has the room. */
  placeEmpty() {
    const ground = this.root.querySelector('.urc-grid > [data-place="ground"]');
    const isEmpty = ground !== null && emptyWords(ground) !== "";
    this.el.toggleAttribute("data-empty", isEmpty);
    if (!ground || !isEmpty || matchMedia("(height < 30rem)").matches) return false;
    const [room, view] = [boxOf(this.el), boxOf(ground)];
    const { height } = boxOf(part(this.el, ".urc-lost-card"));
    const end = isPortraitPhone() ? this.firstBelow(view) : view.bottom;
    const spare = end - view.top - height;
    if (spare < 2 * GAP_PX) return false;
    this.el.style.setProperty("--urc-lost-top", `${Math.round(view.top - room.top + spare / 2)}px`);
    return true;
  }

  /** Return the top of the first cell over the foot of the background. @param {DOMRect} view */
  firstBelow(view) {
    const cells = [...this.root.querySelectorAll('.urc-grid > .urc-cell:not([data-place="ground"])')].map(boxOf);
    return Math.min(view.bottom, ...cells.filter(({ width }) => width > 0).map(({ top }) => top));
  }

  placeBox() {
    const isEmpty = this.placeEmpty();
    this.el.toggleAttribute("data-in-picture", isEmpty);
    if (isEmpty) {
      this.el.removeAttribute("data-low");
      this.el.removeAttribute("data-top");
      for (const view of this.root.querySelectorAll(VIEWS)) view.removeAttribute("data-behind");
      return;
    }
    const room = this.el.getBoundingClientRect();
    const card = part(this.el, ".urc-lost-card").getBoundingClientRect();
    const { paddingTop, paddingBottom } = getComputedStyle(this.el);
    const isTall = isPortraitPhone() && this.root.querySelector('.urc-grid > [data-place="ground"]') !== null;
    const bottom = room.bottom - parseFloat(paddingBottom) + this.footPx;
    const isPlaced = isTall && this.placeLow(room.top, bottom, card.height);
    this.el.toggleAttribute("data-low", isPlaced);
    if (isPlaced) {
      this.el.removeAttribute("data-top");
      return;
    }
    this.footPx = 0;
    const { height } = card;
    const old = this.root.querySelectorAll('.urc-cell[data-old]:not([data-place="ground"], [data-footprint="view"])');
    const values = [...old].filter((el) => el.checkVisibility()).map((el) => el.getBoundingClientRect());
    const covers = (/** @type {number} */ y) =>
      values.filter((one) => one.left < card.right && one.right > card.left && one.top < y + height && one.bottom > y).length;
    const below = covers(bottom - height);
    this.el.toggleAttribute("data-top", covers(room.top + parseFloat(paddingTop)) < below);
  }

  /**
   * Put the card as low as possible, near the thumb, between the cells that stay in sight. If no place is
   * high enough, the card also takes the place of views, or else lies over the background.
   *
   * @param {number} top first pixel of the stage on the screen
   * @param {number} bottom last pixel above STOP
   * @param {number} height of the card
   * @returns {boolean} whether the card has a place
   */
  placeLow(top, bottom, height) {
    const ground = [...this.root.querySelectorAll('.urc-grid > [data-place="ground"]')].map(boxOf);
    const views = [...this.root.querySelectorAll(VIEWS)];
    const kept = [...this.root.querySelectorAll(KEPT)].map(boxOf);
    const seen = [...kept, ...views.map(boxOf)];
    const places = [[...seen, ...ground], [...kept, ...ground], seen].map((boxes) => lowestGap(boxes, top, bottom, height));
    const at = places.findIndex((one) => one !== null);
    const foot = places[at] ?? null;
    const isCovered = (/** @type {DOMRect} */ box) => foot !== null && box.bottom > foot - height && box.top < foot;
    for (const view of views) view.toggleAttribute("data-behind", at === 1 && isCovered(boxOf(view)));
    if (foot === null) return false;
    this.footPx = Math.max(0, Math.round(bottom - foot));
    this.el.style.setProperty("--urc-lost-foot", `${this.footPx}px`);
    return true;
  }

  /** @param {Loss} loss */
  say(loss) {
    const title = this.el.dataset["robot"] ?? "";
    const { heading, cause, step, isForeign } = wordsOf(loss, title);
    this.title.textContent = heading;
    this.cause.textContent = cause;
    if (isForeign) this.cause.lang = "en";
    else this.cause.removeAttribute("lang");
    this.step.textContent = (loss.of === "robot" && this.hint(loss.transport)) || step;
  }

  /** Return the driver's hint for a transport. @param {string} transport */
  hint(transport) {
    const hints = JSON.parse(this.el.dataset["hints"] ?? "{}");
    return Object.hasOwn(hints, transport) ? String(hints[transport]) : "";
  }
}

function isPortraitPhone() {
  return matchMedia("(width < 37.5rem)").matches;
}

/** @param {Element} el */
function boxOf(el) {
  return el.getBoundingClientRect();
}

/**
 * Return the end of the lowest free place between boxes of a screen, without a gap at each box.
 *
 * @param {readonly {top: number, bottom: number}[]} boxes in pixels; empty ones do not count
 * @param {number} top first pixel of the screen that counts
 * @param {number} bottom last pixel of the screen that counts
 * @param {number} height height that is needed, in pixels
 * @returns {number | null} last pixel of the place; null if no place is high enough
 */
export function lowestGap(boxes, top, bottom, height) {
  const sorted = boxes.filter((one) => one.bottom > one.top && one.top < bottom).sort((one, other) => other.bottom - one.bottom);
  let foot = bottom;
  for (const box of sorted) {
    if (foot - (box.bottom + GAP_PX) >= height) return foot;
    foot = Math.min(foot, box.top - GAP_PX);
  }
  return foot - top >= height ? foot : null;
}

/**
 * @typedef {{of: "robot", transport: string, cause: string, address: string, detail: string}} RobotLoss
 * @typedef {{of: "server", detail: ""}} ServerLoss
 * @typedef {{of: "session", detail: string}} SessionLoss The server closed the connection, with a reason.
 * @typedef {RobotLoss | ServerLoss | SessionLoss} Loss
 */

/**
 * @param {Loss} loss
 * @param {string} title title of the robot
 * @returns {{heading: string, cause: string, step: string, isForeign: boolean}}
 */
export function wordsOf(loss, title) {
  switch (loss.of) {
    case "robot":
      return { heading: t("Cannot reach {title}", { title }), ...causeWords(loss.cause, loss.address, loss.detail) };
    case "session":
      return { heading: t("Cannot open {title}", { title }), cause: said(loss.detail), step: stepOf(loss.detail), isForeign: false };
    case "server":
      return { heading: t("No connection to URC"), cause: "", step: t("Is the server running? Is this device on its network?"), isForeign: false };
  }
}

/**
 * Return the age of the background behind the card; "" without a background or without an age.
 *
 * @param {Element | null} ground
 */
export function lastWords(ground) {
  const age = ground?.getAttribute("data-old-age");
  if (!ground || !age) return "";
  return ground.hasAttribute("data-picture") ? t("Last picture: {age} ago", { age }) : t("Last values: {age} ago", { age });
}

/**
 * Return the words for a background without a picture; "" for any other background.
 *
 * @param {Element | null} ground
 */
export function emptyWords(ground) {
  if (!ground?.hasAttribute("data-picture") || ground.hasAttribute("data-old-age")) return "";
  return t("No picture: not connected");
}

/**
 * Return the number of failed attempts and the duration of the loss. They change every second, so
 * screen readers do not announce them.
 *
 * @param {Loss} loss
 * @param {Store} store
 * @param {number} lostMs time at which the page noticed the loss
 * @param {number} nowMs
 */
export function triesWords(loss, store, lostMs, nowMs) {
  if (loss.of !== "robot") return [lostForText(nowMs - lostMs), t("This page keeps trying")].filter(Boolean).join(" · ");
  const attempts = store.links.get(loss.transport)?.attempts ?? 0;
  const lostFor = lostForText(nowMs - (store.downMs.get(loss.transport) ?? lostMs));
  return [attemptsText(attempts), lostFor, t("URC keeps trying")].filter(Boolean).join(" · ");
}

/**
 * Return the kind of loss: the server, the robot's session, or the whole robot. A robot with at
 * least one good connection is not lost.
 *
 * @param {Store} store
 * @param {import("./socket.js").Socket} socket
 * @param {readonly string[]} onDemand transports that only commands open, which do not count as
 *   lost
 * @returns {Loss | null}
 */
export function lossOf(store, socket, onDemand = []) {
  if (!store.isUp) {
    if (socket.failures === 0 || socket.isShutOut) return null;
    return socket.refusal ? { of: "session", detail: socket.refusal } : { of: "server", detail: "" };
  }
  const links = [...store.links.values()].filter(({ transport }) => !onDemand.includes(transport));
  const lost = links.find(({ state }) => state === "lost");
  if (!lost || links.some(isConnected)) return null;
  const { transport, cause, address, detail } = lost;
  return { of: "robot", transport, cause, address, detail };
}

/**
 * Return whether the page waits for the server or for a first connection.
 *
 * @param {Store} store
 * @param {readonly string[]} onDemand
 */
export function waitsIn(store, onDemand) {
  if (!store.isUp) return true;
  const links = [...store.links.values()].filter(({ transport }) => !onDemand.includes(transport));
  return links.some(({ state, ready }) => state === "connecting" && !ready);
}

/** @param {Link} link */
function isConnected({ state }) {
  return state === "live" || state === "silent";
}
