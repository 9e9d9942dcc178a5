// @ts-check
/**
 * The commands of a robot, with arguments, a preview of frames, and results. The module uses no
 * socket.
 *
 * @typedef {import("../core/types.js").Value} Value
 * @typedef {import("./try.js").Line} Line
 *
 * @typedef {import("./fields.js").Argument} Argument
 *
 * @typedef {object} Command
 * @property {string} name
 * @property {string} title
 * @property {string} transport
 * @property {boolean} held
 * @property {number} steps
 * @property {Argument[]} arguments
 *
 * @typedef {object} Frame
 * @property {string} transport
 * @property {string} note
 * @property {string} data
 * @property {number} size
 * @property {string} verb
 * @property {string} address
 * @property {string} more
 * @property {string} text
 *
 * @typedef {{refusal: string, frames: Frame[], questions: string[], requires: string[]}} Shown
 *
 * @typedef {object} Desk Functions for sending requests and commands.
 * @property {(message: object) => Promise<any>} ask
 * @property {(command: string, args: Record<string, unknown>, isConfirmed: boolean) => Promise<Record<string, unknown>>} run
 */
import { bytesOf, element, hexOf, listElement, sizeText, textOf, visible, wordsOf } from "./bytes.js";
import { button, field, valuesOf } from "./fields.js";

export class Commands {
  /**
   * @param {HTMLElement} el
   * @param {Desk} desk
   */
  constructor(el, desk) {
    this.el = el;
    this.desk = desk;
    /** @type {Map<string, Line>} */
    this.lines = new Map();
    this.key = "";
  }

  /**
   * @param {Command[]} commands
   * @param {Line[]} lines
   */
  set(commands, lines) {
    this.lines = new Map(lines.map((line) => [line.name, line]));
    const key = JSON.stringify(commands);
    if (key === this.key) return; // filled-in values stay
    this.key = key;
    const none = element("p", "dev-quiet", "This robot has no commands.");
    this.el.replaceChildren(...(commands.length ? commands.map((one) => this.command(one)) : [none]));
  }

  /** @param {Command} command */
  command(command) {
    const el = element("details", "dev-command");
    const summary = element("summary", "");
    summary.append(element("span", "", command.name), element("span", "dev-quiet", about(command)));
    const form = document.createElement("form");
    form.className = "dev-form";
    const fields = element("div", "dev-tools");
    const inputs = command.arguments.map((argument) => field(argument));
    fields.append(...inputs.map(({ label }) => label));
    const buttons = element("div", "dev-tools");
    const preview = button("Preview", "submit");
    buttons.append(preview);
    const result = element("div", "dev-result");
    result.setAttribute("role", "status");
    const given = () => valuesOf(inputs);
    if (command.held) {
      buttons.append(element("p", "dev-quiet", "It moves the robot while it is held: it is given on the interface."));
    } else {
      const send = button("Send", "button");
      send.addEventListener("click", () => void this.send(command, given(), result));
      buttons.append(send);
    }
    form.append(fields, buttons, result);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.preview(command, given(), result);
    });
    el.append(summary, form);
    return el;
  }

  /**
   * @param {Command} command
   * @param {Record<string, unknown>} values
   * @param {HTMLElement} result
   * @returns {Promise<Shown | null>}
   */
  async preview(command, values, result) {
    try {
      const shown = await this.desk.ask({ t: "show", command: command.name, arguments: values });
      result.replaceChildren(...this.shownElements(shown));
      return shown;
    } catch (error) {
      result.replaceChildren(element("p", "dev-bad", `▲ ${wordsOf(error)}`));
      return null;
    }
  }

  /**
   * @param {Command} command
   * @param {Record<string, unknown>} values
   * @param {HTMLElement} result
   */
  async send(command, values, result) {
    const shown = await this.preview(command, values, result);
    if (!shown || shown.refusal) return;
    if (shown.questions.length === 0) {
      await this.run(command, values, result);
      return;
    }
    const yes = button("Yes, send it", "button");
    yes.addEventListener("click", () => void this.run(command, values, result, true), { once: true });
    result.append(yes);
    yes.focus();
  }

  /**
   * @param {Command} command
   * @param {Record<string, unknown>} values
   * @param {HTMLElement} result
   * @param {boolean} isConfirmed whether the operator has confirmed the command
   */
  async run(command, values, result, isConfirmed = false) {
    result.replaceChildren(element("p", "dev-quiet", "… waiting for the robot"));
    try {
      const reply = await this.desk.run(command.name, values, isConfirmed);
      const told = Object.entries(reply).map(([name, value]) => `${name} = ${JSON.stringify(value)}`);
      result.replaceChildren(element("p", "", "✓ done"), listElement(told));
    } catch (error) {
      result.replaceChildren(element("p", "dev-bad", `▲ ${wordsOf(error)}`));
    }
  }

  /** @param {Shown} shown */
  shownElements(shown) {
    if (shown.refusal) return [element("p", "dev-bad", `▲ refused: ${visible(shown.refusal)}`)];
    const found = shown.frames.map((frame) => this.frameElement(frame));
    found.push(...shown.requires.map((text) => element("p", "dev-caution", `◆ it requires: ${text}`)));
    found.push(...shown.questions.map((text) => element("p", "dev-caution", `◆ it asks: ${text}`)));
    return found;
  }

  /** @param {Frame} frame */
  frameElement(frame) {
    const el = element("div", "dev-piece");
    if (frame.note) {
      el.append(element("p", "dev-quiet", visible(frame.note)));
      return el;
    }
    const bytes = bytesOf(frame.data);
    const encoding = this.lines.get(frame.transport)?.encoding ?? "utf-8";
    if (frame.verb) {
      const address = [frame.verb, frame.address, frame.more].filter(Boolean).join(" ");
      el.append(element("p", "", `on ${frame.transport}: ${visible(address)}`));
      const body = frame.text ? visible(frame.text) : textOf(bytes, encoding);
      if (body) el.append(element("code", "", body));
      return el;
    }
    el.append(element("p", "dev-quiet", `on ${frame.transport}, ${sizeText(frame.size)}`));
    el.append(element("p", "dev-hex", hexOf(bytes)), element("code", "", textOf(bytes, encoding)));
    return el;
  }
}

/** @param {Command} command */
function about(command) {
  const words = [command.title, command.steps ? `${command.steps} steps` : `on ${command.transport}`];
  return [...words, command.held ? "held" : ""].filter(Boolean).join(" · ");
}
