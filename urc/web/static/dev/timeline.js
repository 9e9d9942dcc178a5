// @ts-check
/**
 * The robot's audit log as an explanation of motion, newest first, loaded on demand.
 *
 * @typedef {import("../core/audit_entry.js").Entry} Entry
 */
import { detailsOf, levelOf, signOf, timeOf } from "../core/audit_entry.js";
import { part } from "../live/badge.js";
import { element, visible, wordsOf } from "./bytes.js";

const MOST = 200;
const ANSWER_WITHIN_MS = 10_000;

export class Timeline {
  /**
   * @param {ParentNode} root
   * @param {string} url
   */
  constructor(root, url) {
    this.url = url;
    this.list = part(root, "[data-why]");
    this.state = part(root, "[data-why-state]");
    this.isAsking = false;
    part(root, "[data-why-refresh]").addEventListener("click", () => this.refresh());
  }

  /** Reload the log; the old entries stay until the response arrives. */
  async refresh() {
    if (this.isAsking) return;
    this.isAsking = true;
    try {
      const { entries, fault } = await this.ask();
      this.list.replaceChildren(...entries.map(row));
      this.state.textContent = fault ? `▲ nothing new is kept: ${visible(fault)}` : told(entries);
    } catch (error) {
      this.state.textContent = `▲ ${wordsOf(error)}`;
    } finally {
      this.isAsking = false;
    }
  }

  /** @returns {Promise<{entries: Entry[], fault: string}>} newest first */
  async ask() {
    const answer = await fetch(`${this.url}?last=${MOST}`, {
      cache: "no-store",
      signal: AbortSignal.timeout(ANSWER_WITHIN_MS),
    });
    const found = await answer.json();
    if (!answer.ok) throw new Error(found.error ?? `URC answered ${answer.status}`);
    return found;
  }
}

/** @param {Entry[]} entries */
function told(entries) {
  if (entries.length === 0) return "No entries yet.";
  const older = entries.length === MOST ? ", 'urc audit' shows older ones" : "";
  const asked = new Date().toLocaleTimeString("en-GB", { hour12: false });
  return `${entries.length} entries at ${asked}${older}`;
}

/** @param {Entry} entry */
function row(entry) {
  const el = element("li", "dev-row");
  el.dataset["what"] = entry.what;
  const level = levelOf(entry.what);
  if (level) el.dataset["level"] = level;
  const head = element("div", "dev-row-head");
  head.append(
    element("span", "", timeOf(entry.at).join(" ")),
    element("span", "dev-row-sign", visible(signOf(entry.what))),
    element("span", "", visible(whoText(entry))),
  );
  el.append(head, element("span", "dev-row-wide", visible(detailsOf(entry).join(" · "))));
  if (entry.data) el.append(element("span", "dev-row-wide dev-hex", visible(entry.data)));
  return el;
}

/** @param {Entry} entry */
function whoText({ who, role, way, place, client, epoch }) {
  const more = [role, way, place, client, epoch ? `lease ${epoch}` : ""].filter(Boolean).join(", ");
  return more ? `${who} (${more})` : who;
}
