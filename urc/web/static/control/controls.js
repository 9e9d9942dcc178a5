// @ts-check
/**
 * The control bar below the widgets of a robot with motion: the operator in control, and STOP.
 *
 * @typedef {import("./drive.js").Drive} Drive
 * @typedef {import("./drive.js").Verb} Verb
 * @typedef {import("./stop.js").StopButton} StopButton
 * @typedef {import("../core/types.js").StopState} StopState
 */
import { part } from "../live/badge.js";
import { whenPressed } from "./pointer_press.js";
import { inTurn } from "../core/formatting.js";
import { said, t } from "../core/words.js";

/** @type {Verb[]} */
const VERBS = ["reset", "take", "ask", "force", "yes", "no", "override", "leave"];
/** Duration of the ring around Reset after a press on a stopped control. */
const POINTED_MS = 1500;
/** A stick, which takes control when it is touched. */
const STICK = '.urc-cell[data-footprint="stick"]';
/** Verbs of operators who want to drive. @type {ReadonlySet<Verb>} */
const BEFORE_DRIVING = new Set(["reset", "take", "ask", "force"]);

export class Controls {
  /**
   * @param {ParentNode} root the page
   * @param {HTMLElement} el
   * @param {Drive} drive
   * @param {StopButton} stop
   * @param {import("./input.js").Input} input
   */
  constructor(root, el, drive, stop, input) {
    this.el = el;
    this.drive = drive;
    this.input = input;
    /** Whether the next Tab from a held control moves the focus to Reset. */
    this.isResetNext = false;
    /** Timer of the ring around Reset. @type {ReturnType<typeof setTimeout> | undefined} */
    this.pointing = undefined;
    this.who = part(el, "[data-who]");
    this.take = part(el, '[data-verb="take"]');
    this.takeWho = part(el, "[data-take-who]");
    this.takeWay = part(el, "[data-take-way]");
    this.latched = part(root, "[data-latched]");
    this.latchedText = part(root, "[data-latched-text]");
    this.latchedNext = part(root, "[data-latched-next]");
    this.latchedWhen = part(root, "[data-latched-when]");
    this.stop = part(el, "[data-stop-button]");
    this.stopNote = part(el, "[data-stop-note]");
    /** Whether the latched STOP is confirmed, and the robot is connected. */
    this.isProven = false;
    /** @type {[Verb, HTMLElement][]} */
    this.buttons = VERBS.map((verb) => [verb, part(root, `[data-verb="${verb}"]`)]);
    for (const [verb, button] of this.buttons) {
      button.addEventListener("click", () => {
        drive.say(verb);
        drive.changed();
      });
    }
    whenPressed(this.stop, () => stop.press());
    this.stop.removeAttribute("data-early-stop"); // armed: early_stop.js leaves it alone
    stop.follow((state) => this.showStop(state));
    addEventListener("keydown", (event) => this.tabToReset(event));
    root.addEventListener("pointerdown", ({ target }) => {
      if (target instanceof Element && target.closest("[data-stopped]")) this.pointAtReset();
    });
  }

  /** Draw a ring around Reset for a moment: a press elsewhere has no effect before it. */
  pointAtReset() {
    const reset = this.buttons[0]?.[1];
    reset?.toggleAttribute("data-pointed", true);
    clearTimeout(this.pointing);
    this.pointing = setTimeout(() => reset?.toggleAttribute("data-pointed", false), POINTED_MS);
  }

  /**
   * Make the first Tab after STOP move the focus from a held control to Reset, which would
   * otherwise take many Tabs. STOP must not move the focus itself, because a second press of Space
   * would then press Reset.
   *
   * @param {KeyboardEvent} event
   */
  tabToReset(event) {
    const reset = this.buttons[0]?.[1];
    if (event.key !== "Tab" || event.shiftKey || !this.isResetNext || !reset || reset.hidden) return;
    if (event.defaultPrevented || !this.input.owns(event.target)) return;
    event.preventDefault();
    this.isResetNext = false;
    reset.focus();
  }

  /**
   * Move the keyboard focus away from a button that disappears.
   *
   * @param {Verb} verb
   */
  moveFocus(verb) {
    const next = this.buttons.find(([, button]) => !button.hidden)?.[1];
    if (BEFORE_DRIVING.has(verb) || !next) this.input.focus();
    else next.focus();
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
    const isBlind = isMine && !isAsked && drive.overrideMs <= nowMs && this.input.isBlind(nowMs);
    /** @type {Record<Verb, boolean>} */
    const shown = {
      reset: isLatched && may,
      take: isFree && may,
      ask: isOthers && may && !lease.asker,
      force: isOthers && may && lease.forces,
      yes: isAsked,
      no: isAsked,
      override: isBlind,
      // A second button would move STOP on small screens.
      leave: isMine && !isAsked && !isBlind,
    };
    const left = this.buttons.find(([verb, button]) => !shown[verb] && button.matches(BEFORE_DRIVING.has(verb) ? ":focus" : ":focus-visible"))?.[0];
    for (const [verb, button] of this.buttons) {
      if (button.hidden === shown[verb]) button.hidden = !shown[verb];
    }
    if (left) this.moveFocus(left);
    const leftS = Math.max(0, Math.ceil((drive.handedMs - nowMs) / 1000));
    const text = drive.refusal ? `◆ ${said(drive.refusal)}` : this.words(isMine, isAsked, iAsk, leftS, (drive.overrideMs - nowMs) / 1000);
    if (this.who.textContent !== text) this.who.textContent = text;
    if (shown.take) this.nameTake(text);
    const stopped = isLatched ? this.stoppedWords() : "";
    if (this.latchedNext.hidden === may) this.latchedNext.hidden = !may;
    if (this.latchedText.textContent !== stopped) this.latchedText.textContent = stopped;
    const when = isLatched ? this.stoppedWhen() : "";
    if (this.latchedWhen.textContent !== when) {
      this.latchedWhen.textContent = when;
      this.latchedWhen.hidden = when === "";
    }
    if (this.latched.hidden === isLatched) {
      this.latched.hidden = !isLatched;
      this.isResetNext = isLatched;
    }
    this.nameStop(this.isProven && isLatched && lease !== null);
    const state = isLatched ? "latched" : isMine ? "mine" : isOthers ? "others" : "free";
    if (this.el.dataset["state"] !== state) this.el.dataset["state"] = state;
  }

  /**
   * @param {boolean} isMine
   * @param {boolean} isAsked
   * @param {boolean} iAsk
   * @param {number} leftS
   * @param {number} blindS time for which this page may still drive without an image
   */
  words(isMine, isAsked, iAsk, leftS, blindS) {
    const lease = this.drive.lease;
    if (!lease) return this.drive.socket.refusal ? t("Not connected to the robot") : t("Not connected to URC");
    const [asker, holder] = [said(lease.asker?.name ?? ""), said(lease.holder?.name ?? "")];
    if (isAsked) return t("◆ {who} asks to drive: {seconds} s", { who: asker, seconds: leftS });
    if (isMine && blindS > 0) return t("▲ Blind: {seconds} s", { seconds: Math.ceil(blindS) });
    if (isMine) return t("● You drive");
    if (iAsk) return t("Asked {who}: {seconds} s", { who: holder, seconds: leftS });
    if (lease.holder) return t("{who} is driving", { who: holder });
    if (lease.latched) return ""; // the bar says it
    return lease.drives ? t("No one drives") : t("No one drives; this page only watches");
  }

  /**
   * Name the button that says who drives, and how to drive: a touch of a stick does the same as a press
   * of the button. The state is the first line, and the way to drive a quieter second line.
   *
   * @param {string} who
   */
  nameTake(who) {
    const sticks = document.querySelectorAll(STICK).length;
    const held = this.input.grips.size > 0 ? t("hold a control") : t("take control");
    const way = sticks === 0 ? held : sticks === 1 ? t("touch the stick") : t("touch a stick");
    const name = `${who}: ${way}. ${t("Take control")}`;
    if (this.take.getAttribute("aria-label") === name) return;
    this.takeWho.textContent = who;
    this.takeWay.textContent = way;
    this.take.setAttribute("aria-label", name);
  }

  /** Return the text in the bar for a latched STOP. */
  stoppedWords() {
    const { lease, posted } = this.drive;
    const by = lease?.latched || posted?.latched || "";
    return by && by === lease?.name ? t("■ Stopped by you") : t("■ Stopped by {who}", { who: said(by) });
  }

  /** Return the time of the latched STOP as text; "" if this page does not know the time. */
  stoppedWhen() {
    const atMs = this.drive.latchedAtMs;
    if (atMs === null) return "";
    const time = new Date(atMs).toLocaleTimeString([], { hour: "2-digit", minute: "2-digit", hour12: false });
    return t("at {time}", { time });
  }

  /**
   * Show the word on the button: STOP, or STOPPED for a latched STOP. Without a confirmation or a
   * connection, the button keeps the word STOP.
   *
   * @param {boolean} isStopped
   */
  nameStop(isStopped) {
    const word = isStopped ? t("STOPPED") : "STOP";
    if (this.stop.textContent === word) return;
    this.stop.textContent = word;
    if (isStopped) this.stop.setAttribute("aria-label", t("STOPPED: press to send STOP again"));
    else this.stop.removeAttribute("aria-label");
    this.stop.title = isStopped ? t("Press to send STOP again") : "";
  }

  /** @param {StopState} state */
  showStop({ phase, isLatched, isConfirmed, fault }) {
    const isSent = phase !== "" && phase !== "sending" && phase !== "failed";
    this.stop.dataset["phase"] = fault && !isConfirmed ? "fault" : phase;
    this.isProven = phase === "confirmed" && fault === "";
    const steps = [
      isSent ? t("✓ sent") : "",
      isConfirmed ? t("✓ confirmed") : "",
      isLatched ? t("✓ latched") : "",
    ].filter(Boolean);
    let note = inTurn(steps);
    if (phase === "sending") note = t("… sending");
    if (phase === "failed" || (fault && !isConfirmed)) {
      if (phase === "failed") note = t("▲ NO LINK: use the robot's own stop switch");
      else note = isLatched ? t("▲ NO LINK, latched") : t("▲ NO LINK");
    }
    if (this.stopNote.textContent !== note) this.stopNote.textContent = note;
  }
}
