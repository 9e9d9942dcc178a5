// @ts-check
/**
 * Confirmations of commands, shown in the widget's cell. They cover nothing else, so STOP stays
 * reachable. No answer means no.
 *
 * For the two-person rule, the server also asks the other pages. Their questions are shown below
 * the page's heading.
 *
 * @typedef {import("../core/types.js").Value} Value
 * @typedef {import("../core/types.js").Question} Question
 *
 * @typedef {object} Ticket An operator's confirmation.
 * @property {(run: number) => void} began reports that the command is under way
 * @property {() => void} close
 */
import { slide } from "./slide_to_confirm.js";
import { t } from "../core/words.js";

/** Time limits of normal questions and of questions about a hazard. */
const ASK_MS = 10_000;
const HAZARD_MS = 5000;
/**
 * Taps within this time after the first tap do not count, because the operator has not read the
 * question yet.
 */
const READ_MS = 400;

/**
 * Return the questions before a command with these arguments.
 *
 * @param {readonly Question[]} asks
 * @param {Record<string, import("../core/types.js").Given>} args
 * @returns {Question[]}
 */
export function questionsOf(asks, args) {
  return asks.filter(({ argument, value }) => !argument || String(args[argument] ?? "") === value);
}

/**
 * Show the remaining time as a shrinking edge of the question. Each call starts with the full edge.
 *
 * @param {HTMLElement} box
 * @param {number} limitMs
 */
function showTime(box, limitMs) {
  box.style.setProperty("--urc-ask-time", `${limitMs}ms`);
  box.dataset["time"] = box.dataset["time"] === "even" ? "odd" : "even"; // another name restarts the motion
}

export class ConfirmDialog {
  /**
   * @param {HTMLElement} heading element after which questions of other pages are shown
   * @param {(message: object) => boolean} say
   */
  constructor(heading, say) {
    this.heading = heading;
    this.say = say;
    /** Number of a command → its question to a second person. @type {Map<number, {number: number, isWithdrawn: boolean, tell: (leftMs: number) => void}>} */
    this.waiting = new Map();
    /** Questions of other pages. @type {Map<number, HTMLElement>} */
    this.others = new Map();
    /** Functions that withdraw the open questions in cells. @type {Set<(why: string) => void>} */
    this.standing = new Set();
  }

  /**
   * Ask in the cell; reject with an Error named "Cancelled" if the answer is no.
   *
   * @param {HTMLElement} cell
   * @param {Question[]} questions
   * @param {AbortSignal} signal
   * @returns {Promise<Ticket>}
   */
  ask(cell, questions, signal) {
    const isHazard = questions.some(({ level }) => level === "hazardous");
    const isTwo = questions.some(({ isTwoPerson }) => isTwoPerson);
    const words = [...new Set(questions.map(({ text }) => text))].join(" ");
    const before = document.activeElement;
    const end = new AbortController();
    signal.addEventListener("abort", () => end.abort());
    const box = element("div", "urc-ask", "");
    box.setAttribute("role", "group");
    const text = element("p", "urc-ask-words", `${isHazard ? "▲ " : ""}${words}`);
    text.setAttribute("role", "alert");
    const no = button(t("Cancel"));
    const yes = isHazard ? element("div", "", "") : button(t("Yes"));
    box.append(text, no, yes);
    const { top, bottom, left, right } = cell.getBoundingClientRect();
    box.toggleAttribute("data-up", top + bottom > innerHeight);
    box.toggleAttribute("data-left", left + right > innerWidth);
    cell.append(box);
    cell.classList.add("urc-asking");
    if (before && cell.contains(before)) no.focus();

    const close = () => {
      end.abort();
      const hadFocus = box.contains(document.activeElement);
      box.remove();
      cell.classList.remove("urc-asking");
      if (hadFocus && before instanceof HTMLElement) before.focus();
    };
    return new Promise((resolve, reject) => {
      const askedMs = performance.now();
      const refuse = (/** @type {string} */ why) => {
        this.standing.delete(refuse);
        close();
        reject(cancelled(why));
      };
      this.standing.add(refuse);
      end.signal.addEventListener("abort", () => this.standing.delete(refuse));
      const limitMs = isHazard ? HAZARD_MS : ASK_MS;
      let expiring = window.setTimeout(() => refuse(t("Not confirmed")), limitMs);
      showTime(box, limitMs);
      const agree = () => {
        clearTimeout(expiring);
        delete box.dataset["time"];
        yes.remove();
        no.hidden = !isTwo;
        text.textContent = isTwo ? t("Waiting for a second person") : t("… sending");
        resolve(this.ticket(isTwo, text, no, close));
      };
      signal.addEventListener("abort", () => reject(cancelled(t("Cancelled"))));
      end.signal.addEventListener("abort", () => clearTimeout(expiring));
      no.addEventListener("click", () => refuse(t("Cancelled")), { signal: end.signal, once: true });
      box.addEventListener("keydown", (event) => {
        if (event.key !== "Escape") return;
        event.preventDefault(); // here, Escape means no instead of STOP
        no.click();
      }, { signal: end.signal });
      const isRead = () => performance.now() - askedMs > READ_MS;
      if (isHazard) {
        slide(yes, {
          label: t("Slide to confirm"),
          signal: end.signal,
          isReady: isRead,
          touched: () => {
            clearTimeout(expiring);
            expiring = window.setTimeout(() => refuse(t("Not confirmed")), HAZARD_MS);
            showTime(box, HAZARD_MS);
          },
          done: agree,
        });
      } else if (yes instanceof HTMLButtonElement) {
        yes.disabled = true;
        setTimeout(() => (yes.disabled = false), READ_MS);
        yes.addEventListener("click", agree, { signal: end.signal });
      }
    });
  }

  /**
   * @param {boolean} isTwo
   * @param {HTMLElement} text
   * @param {HTMLElement} no
   * @param {() => void} close
   * @returns {Ticket}
   */
  ticket(isTwo, text, no, close) {
    let run = -1;
    /** @type {number | undefined} */
    let counting;
    return {
      began: (id) => {
        run = id;
        if (!isTwo) return;
        const one = {
          number: 0,
          isWithdrawn: false,
          tell: (/** @type {number} */ leftMs) => {
            const endMs = performance.now() + leftMs;
            const count = () => {
              const seconds = Math.max(0, Math.ceil((endMs - performance.now()) / 1000));
              text.textContent = t("Waiting for a second person: {seconds} s", { seconds });
            };
            text.removeAttribute("role"); // announced once, not every second
            count();
            clearInterval(counting);
            counting = window.setInterval(count, 1000);
          },
        };
        this.waiting.set(id, one);
        no.addEventListener("click", () => {
          one.isWithdrawn = true;
          if (one.number) this.say({ t: "agree", n: one.number, yes: false });
        });
      },
      close: () => {
        clearInterval(counting);
        this.waiting.delete(run);
        close();
      },
    };
  }

  /** @param {{t: string, n: number, id: number, who: string, command: string, text: string, level: string, left: number}} message */
  take(message) {
    if (message.t === "asked") {
      this.others.get(message.n)?.remove();
      this.others.delete(message.n);
      return;
    }
    if (message.id) {
      const mine = this.waiting.get(message.id);
      if (!mine) return;
      mine.number = message.n;
      if (mine.isWithdrawn) this.say({ t: "agree", n: message.n, yes: false });
      else mine.tell(message.left);
      return;
    }
    if (!this.others.has(message.n)) this.show(message);
  }

  /** Withdraw all confirmations after STOP. @param {string} why */
  stopped(why) {
    for (const refuse of [...this.standing]) refuse(why);
  }

  /** Remove all questions after a loss of the connection to the server. */
  lost() {
    for (const box of this.others.values()) box.remove();
    this.others.clear();
  }

  /** @param {{n: number, who: string, command: string, text: string, level: string}} message */
  show({ n, who, command, text, level }) {
    const box = element("div", "urc-asked", "");
    box.setAttribute("role", "group");
    const words = element("p", "urc-ask-words", t("◆ {who} asks: {text} ({command})", { who, text, command }));
    words.setAttribute("role", "alert");
    const no = button(t("Refuse"));
    no.addEventListener("click", () => this.say({ t: "agree", n, yes: false }));
    const agree = () => this.say({ t: "agree", n, yes: true });
    const yes = level === "hazardous" ? element("div", "", "") : button(t("Agree"));
    const end = new AbortController();
    if (level === "hazardous") slide(yes, { label: t("Slide to agree"), done: agree, signal: end.signal });
    else yes.addEventListener("click", agree);
    box.append(words, no, yes);
    this.heading.append(box);
    this.others.set(n, box);
  }
}

/** @param {string} why */
function cancelled(why) {
  const error = new Error(why);
  error.name = "Cancelled";
  return error;
}

/** @param {string} text */
function button(text) {
  const made = document.createElement("button");
  made.type = "button";
  made.className = "urc-button";
  made.textContent = text;
  return made;
}

/**
 * @param {string} name
 * @param {string} className
 * @param {string} text
 */
function element(name, className, text) {
  const made = document.createElement(name);
  made.className = className;
  made.textContent = text;
  return made;
}
