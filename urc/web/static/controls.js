// @ts-check
/**
 * The bar below the widgets of a robot that moves: who drives, and STOP.
 *
 * @typedef {import("./drive.js").Drive} Drive
 * @typedef {import("./drive.js").Verb} Verb
 * @typedef {import("./stop.js").StopButton} StopButton
 * @typedef {import("./types.js").StopState} StopState
 */
import { part } from "./badge.js";

/** @type {Verb[]} */
const VERBS = ["reset", "take", "ask", "force", "yes", "no", "leave"];

export class Controls {
  /**
   * @param {HTMLElement} el
   * @param {Drive} drive
   * @param {StopButton} stop
   */
  constructor(el, drive, stop) {
    this.el = el;
    this.drive = drive;
    this.who = part(el, "[data-who]");
    this.stop = part(el, "[data-stop-button]");
    this.stopNote = part(el, "[data-stop-note]");
    /** @type {[Verb, HTMLElement][]} */
    this.buttons = VERBS.map((verb) => [verb, part(el, `[data-verb="${verb}"]`)]);
    for (const [verb, button] of this.buttons) {
      button.addEventListener("click", () => {
        drive.say(verb);
        drive.changed();
      });
    }
    // It acts when it is touched, not when it is let go; a key and a screen reader have only the click.
    let isPressed = false;
    this.stop.addEventListener("pointerdown", (event) => {
      isPressed = event.button === 0;
      if (isPressed) stop.press();
    });
    this.stop.addEventListener("click", () => {
      if (!isPressed) stop.press();
      isPressed = false;
    });
    stop.follow((state) => this.showStop(state));
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    const { drive } = this;
    const lease = drive.lease;
    const isMine = drive.isMine;
    const isLatched = drive.isLatched;
    const isFree = lease !== null && !lease.holder && !isLatched;
    const isOthers = lease !== null && lease.holder !== null && !isMine;
    const may = lease?.drives ?? false;
    const isAsked = isMine && lease?.asker !== null;
    const iAsk = lease !== null && lease.asker?.id === lease.you;
    /** @type {Record<Verb, boolean>} */
    const shown = {
      reset: isLatched && may,
      take: isFree && may,
      ask: isOthers && may && !lease.asker,
      force: isOthers && may && lease.forces,
      yes: isAsked,
      no: isAsked,
      leave: isMine && !isAsked,
    };
    for (const [verb, button] of this.buttons) {
      if (button.hidden === shown[verb]) button.hidden = !shown[verb];
    }
    const leftS = Math.max(0, Math.ceil((drive.handedMs - nowMs) / 1000));
    const text = drive.refusal ? `◆ ${drive.refusal}` : this.words(isMine, isAsked, iAsk, leftS);
    if (this.who.textContent !== text) this.who.textContent = text;
    const state = isLatched ? "latched" : isMine ? "mine" : isOthers ? "others" : "free";
    if (this.el.dataset["state"] !== state) this.el.dataset["state"] = state;
  }

  /**
   * @param {boolean} isMine
   * @param {boolean} isAsked
   * @param {boolean} iAsk
   * @param {number} leftS
   */
  words(isMine, isAsked, iAsk, leftS) {
    const lease = this.drive.lease;
    if (!lease) return "Not connected to URC";
    if (lease.latched) return `■ Stopped by ${lease.latched === lease.name ? "you" : lease.latched}`;
    if (isAsked) return `◆ ${lease.asker?.name} asks to drive: ${leftS} s`;
    if (isMine) return "● You drive";
    if (iAsk) return `Asked ${lease.holder?.name}: ${leftS} s`;
    if (lease.holder) return `${lease.holder.name} drives`;
    return lease.drives ? "Nobody drives" : "Nobody drives; this page only watches";
  }

  /** @param {StopState} state */
  showStop({ phase, isLatched, isConfirmed, fault }) {
    const isSent = phase !== "" && phase !== "sending" && phase !== "failed";
    this.stop.dataset["phase"] = fault && !isConfirmed ? "fault" : phase;
    const steps = [
      [isSent, "sent"],
      [isConfirmed, "confirmed"],
      [isLatched, "latched"],
    ].filter(([isDone]) => isDone).map(([, word]) => `✓ ${word}`);
    let note = steps.join(" ");
    if (phase === "sending") note = "… sending";
    if (phase === "failed" || (fault && !isConfirmed)) {
      note = `▲ NO LINK${phase === "failed" ? ": stop it by hand" : isLatched ? ", latched" : ""}`;
    }
    if (this.stopNote.textContent !== note) this.stopNote.textContent = note;
  }
}
