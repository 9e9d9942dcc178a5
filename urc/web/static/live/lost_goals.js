// @ts-check
/**
 * The band with the lost goals of all pages: their outcome is unknown, so the robot may go on.
 *
 * The server keeps such a goal until its end is known. A person who sees that the robot has arrived
 * can say so.
 *
 * @typedef {import("../core/types.js").SentGoal} SentGoal
 */
import { t } from "../core/words.js";

export class LostGoals {
  /**
   * @param {HTMLElement} bands
   * @param {boolean} mayAct whether this visitor may say that a goal has ended
   * @param {(message: object) => boolean} say
   */
  constructor(bands, mayAct, say) {
    this.bands = bands;
    this.mayAct = mayAct;
    this.say = say;
    /** The band, while there are lost goals. @type {HTMLElement | null} */
    this.box = null;
    this.look = "";
  }

  /** Show the goals that are lost. @param {readonly SentGoal[]} goals all goals */
  show(goals) {
    const lost = goals.filter(({ isLost }) => isLost);
    const look = JSON.stringify(lost.map(({ number }) => number));
    if (look === this.look) return;
    this.look = look;
    this.box?.remove();
    this.box = lost.length > 0 ? this.made(lost) : null;
    if (this.box) this.bands.append(this.box);
  }

  /** @param {readonly SentGoal[]} lost */
  made(lost) {
    const box = document.createElement("div");
    box.className = "urc-asked urc-lost-goals";
    box.setAttribute("role", "group");
    const words = document.createElement("p");
    words.className = "urc-ask-words";
    words.setAttribute("role", "status");
    const goals = lost.map(({ title, command, by }) => [title || command, by].filter(Boolean).join(" · ")).join(", ");
    words.textContent = t("▲ The robot may still be on its way: {goals}", { goals });
    box.append(words);
    if (this.mayAct) {
      const button = document.createElement("button");
      button.type = "button";
      button.className = "urc-button";
      button.textContent = t("It has ended");
      button.addEventListener("click", () => {
        for (const { number } of lost) this.say({ t: "dismiss", goal: number });
      });
      box.append(button);
    }
    return box;
  }
}
