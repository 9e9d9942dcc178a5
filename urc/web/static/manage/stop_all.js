// @ts-check
/**
 * STOP ALL of the menu: it stops exactly the shown robots that can move, and shows each result.
 *
 * A mouse, a pen and a key act on the press. A finger acts on the tap, or when it has rested: a finger
 * that scrolls away from the button stops nothing. STOP never asks a question.
 *
 * @typedef {import("./card_words.js").Summary} Summary
 * @typedef {import("./card_words.js").Result} Result
 * @typedef {{name: string, title: string, result: Result, reason: string}} RobotStop
 */
import { ask } from "../core/api_client.js";
import { t } from "../core/words.js";

const URL_OF_STOP = "/api/v1/stop";
/** Time limit of a request; the server replies within one second. */
const WITHIN_MS = 3000;
/** Number of robots up to which a request outlives its page; browsers limit the size of such a request. */
const KEPT_ROBOTS = 200;
/** Pause before a request that did not reach the server is sent again. */
const AGAIN_MS = 1000;
/** Time after which a resting finger counts as a tap. */
const REST_MS = 300;
/** Longest tag in the label; a longer tag is replaced by “robots”. */
const TAG_LETTERS = 16;
/** Number of robots without a link that the note names. */
const NAMED = 4;

export class StopAll {
  /**
   * @param {HTMLElement} dock the element around the button and its note
   * @param {() => void} onResult called when results have changed
   */
  constructor(dock, onResult) {
    this.dock = dock;
    this.onResult = onResult;
    this.button = /** @type {HTMLButtonElement} */ (dock.querySelector("[data-stop-all-button]"));
    this.note = /** @type {HTMLElement} */ (dock.querySelector("[data-stop-all-note]"));
    /** Names of the robots that a press stops. @type {string[]} */
    this.names = [];
    /** Newest states by name. @type {Map<string, Summary>} */
    this.robots = new Map();
    /** Results of the last press, by name. @type {Map<string, RobotStop>} */
    this.results = new Map();
    /** Robots whose latch a state has shown since the last press; states of other sites are late. */
    this.latched = new Set();
    /** @type {"" | "sending" | "failed"} */
    this.phase = "";
    /** Number of the last press; an earlier one is not repeated. */
    this.number = 0;
    /** Whether the states of the robots are current. */
    this.isCurrent = false;
    this.listen();
    this.button.hidden = false;
  }

  listen() {
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    let resting;
    let hasActed = false;
    this.button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      hasActed = event.pointerType !== "touch";
      if (hasActed) this.press();
      else resting = setTimeout(() => { hasActed = true; this.press(); }, REST_MS);
    });
    const end = () => clearTimeout(resting);
    for (const name of ["pointercancel", "pointerleave", "pointerup"]) this.button.addEventListener(name, end);
    this.button.addEventListener("contextmenu", (event) => event.preventDefault()); // of a resting finger
    this.button.addEventListener("click", () => {
      end();
      if (!hasActed) this.press();
      hasActed = false;
    });
  }

  /**
   * Take over the newest states of all robots.
   *
   * @param {readonly Summary[]} robots
   */
  follow(robots) {
    this.isCurrent = true;
    this.robots = new Map(robots.map((robot) => [robot.name, robot]));
    for (const [name, one] of this.results) {
      const robot = this.robots.get(name);
      if (robot?.latched) this.latched.add(name);
      else if (robot && this.latched.has(name)) this.results.delete(name); // it was reset
      if (robot?.latched && robot.confirmed) this.results.set(name, { ...one, result: "confirmed", reason: "" });
    }
    this.show();
  }

  /** Without a server, any robot may be in motion. */
  lose() {
    this.isCurrent = false;
    this.show();
  }

  /**
   * Set the robots that a press stops.
   *
   * @param {string[]} shown names of all shown robots
   * @param {string} tag chosen tag; "" if the robots are not chosen by a tag alone
   * @param {boolean} isFiltered whether the menu hides robots
   */
  choose(shown, tag, isFiltered) {
    this.names = shown.filter((name) => this.robots.get(name)?.can_stop);
    const n = this.names.length;
    let label = t("STOP ALL");
    if (isFiltered && tag && tag.length <= TAG_LETTERS) label = t("STOP {n} {tag}", { n, tag });
    else if (isFiltered) label = n === 1 ? t("STOP 1 robot") : t("STOP {n} robots", { n });
    if (this.button.textContent !== label) this.button.textContent = label;
    this.button.hidden = n === 0;
    this.show();
  }

  press() {
    this.number += 1;
    void this.send([...this.names], this.number);
  }

  /**
   * Send STOP until the server has received it.
   *
   * @param {string[]} names
   * @param {number} number
   */
  async send(names, number) {
    this.results = new Map();
    this.latched.clear();
    this.phase = "sending";
    this.show();
    while (number === this.number) {
      try {
        /** @type {{robots: RobotStop[]}} */
        const said = await ask(URL_OF_STOP, { robots: names }, {
          keepalive: names.length <= KEPT_ROBOTS,
          signal: AbortSignal.timeout(WITHIN_MS),
        });
        if (number !== this.number) return;
        this.results = new Map(said.robots.map((one) => [one.name, one]));
        this.phase = "";
        this.onResult();
        break;
      } catch (error) {
        console.warn("URC: STOP could not be delivered:", error);
        if (number !== this.number) return;
        this.phase = "failed";
      }
      this.show();
      await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    }
    this.show();
  }

  show() {
    const said = this.words();
    if (this.note.textContent !== said) this.note.textContent = said;
    this.dock.dataset["bad"] = String(this.phase === "failed" || this.missing().length > 0);
    const look = this.look();
    this.button.dataset["phase"] = look;
    this.button.toggleAttribute("data-quiet", look === "" && this.isAtRest());
  }

  /** Return whether no robot that a press stops is connected. */
  isAtRest() {
    return this.isCurrent && this.results.size === 0 && !this.names.some((name) => this.robots.get(name)?.connected);
  }

  /** Return the look of the button, as of STOP on the page of a robot. */
  look() {
    if (this.phase !== "") return this.phase === "failed" ? "fault" : "sending";
    const states = this.names.map((name) => this.robots.get(name));
    const isStopped = states.length > 0 && states.every((one) => one?.latched);
    if (this.names.some((name) => this.results.get(name)?.result === "no-link")) return "fault";
    return isStopped ? "latched" : "";
  }

  words() {
    if (this.phase === "sending") return t("Stopping");
    if (this.phase === "failed") return t("▲ NO LINK: use the robot's own stop switch");
    const n = this.results.size;
    if (n === 0) return "";
    const missing = this.missing();
    const done = t("{done} of {n} stopped", { done: n - missing.length, n });
    if (missing.length === 0) return `✓ ${done}`;
    const named = missing.slice(0, NAMED).map(({ title, name }) => title || name).join(", ");
    const more = missing.length > NAMED ? ` +${missing.length - NAMED}` : "";
    const without = t("▲ NO LINK: {reason}", { reason: named + more });
    return `${done} · ${without}`;
  }

  /** Return the robots that the last press has not stopped yet. */
  missing() {
    return [...this.results.values()].filter(({ result }) => result === "no-link" || result === "refused");
  }
}
