// @ts-check
/**
 * The sheet over the grid: every link with its state, and the log.
 *
 * All content is written as text, because it comes from robots.
 *
 * @typedef {import("../core/types.js").Line} Line
 * @typedef {import("../core/types.js").Link} Link
 * @typedef {import("./store.js").Store} Store
 */
import { part } from "./badge.js";
import { attemptsText, lostForText } from "../core/connection_causes.js";
import { clock } from "../widgets/kit.js";
import { said, t } from "../core/words.js";

const LINES_KEPT = 200;

/** @type {Record<Link["state"], string>} */
const STATES = {
  idle: t("idle"),
  connecting: `◌ ${t("connecting")}`,
  live: `● ${t("live")}`,
  silent: `◆ ${t("silent")}`,
  lost: `▲ ${t("lost")}`,
};
/** @type {Record<Line["level"], string>} */
const SIGNS = { info: "", warning: "◆", error: "▲" };

export class Panel {
  /** @param {HTMLElement} el a details element */
  constructor(el) {
    this.el = el;
    this.links = part(el, "[data-links]");
    this.log = part(el, "[data-log]");
    this.shown = "";
    this.session = "";
    /** Expected number of the next log line. */
    this.next = 0;
    document.querySelector("[data-badge-why]")?.addEventListener("click", () => {
      el.toggleAttribute("open");
      if (el.hasAttribute("open")) part(el, "summary").focus({ preventScroll: true });
    });
  }

  /**
   * @param {Store} store
   * @param {string} reason the server's reason for the missing connection
   * @param {boolean} isRefused whether the server is reachable, but cannot open the robot
   */
  frame(store, reason, isRefused) {
    const links = [...store.links.values()];
    const trying = isRefused ? t("Cannot open the robot; trying again.") : t("No connection to URC; trying again.");
    const last = reason ? t("Last message: {reason}", { reason: said(reason) }) : "";
    const lost = `${trying} ${last}`.trim();
    const key = store.isUp ? JSON.stringify(links) : lost;
    if (key === this.shown) return;
    this.shown = key;
    const parts = links.map((link) => linkElement(link));
    this.links.replaceChildren(...(store.isUp ? parts : [element("p", "urc-quiet", lost)]));
  }

  /**
   * Add lines of the log, newest last. After a reconnect the server repeats the latest lines; known
   * lines are recognized by their number and skipped.
   *
   * @param {Line[]} lines
   * @param {number} first number of the first line in its session, from 0
   * @param {string} session
   */
  addLines(lines, first, session) {
    if (session !== this.session) {
      this.session = session;
      this.next = first;
    }
    if (first > this.next) {
      const text = t("{n} lines are missing here: they arrived too fast for this connection", {
        n: first - this.next,
      });
      this.log.prepend(lineElement({ age: 0, level: "warning", source: "URC", text }));
    }
    for (const line of lines.slice(Math.max(0, this.next - first))) {
      this.log.prepend(lineElement(line));
    }
    this.next = Math.max(this.next, first + lines.length);
    while (this.log.childElementCount > LINES_KEPT) this.log.lastElementChild?.remove();
  }
}

/** @param {Link} link */
function linkElement(link) {
  const el = element("div", "urc-link");
  const state = element("span", "urc-link-state", STATES[link.state] ?? link.state);
  el.append(element("span", "urc-link-name", link.transport), state);
  el.append(element("span", "urc-link-more", link.address));
  if (link.detail) el.append(element("span", "urc-link-more", link.detail));
  const counts = [
    attemptsText(link.attempts),
    link.faults === 1 ? t("1 fault") : link.faults > 0 ? t("{n} faults", { n: link.faults }) : "",
    link.state === "lost" ? lostForText(link.since) : "",
  ].filter(Boolean);
  if (counts.length > 0) el.append(element("span", "urc-link-more", counts.join(" · ")));
  return el;
}

/** @param {Line} line */
function lineElement(line) {
  const el = element("li", "");
  const time = new Date(Date.now() - line.age);
  el.dataset["level"] = line.level;
  el.append(
    element("span", "urc-log-time", clock(time)),
    element("span", "urc-log-sign", SIGNS[line.level] ?? ""),
    `${line.source}: ${line.text}`,
  );
  return el;
}

/**
 * @param {string} name
 * @param {string} className
 * @param {string} [text]
 */
function element(name, className, text) {
  const el = document.createElement(name);
  if (className) el.className = className;
  if (text !== undefined) el.textContent = text;
  return el;
}
