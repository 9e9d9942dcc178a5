// @ts-check
/**
 * All commands, each with a form. Each form is created when it is first opened, because a hundred
 * forms would take a second on a phone.
 *
 * @typedef {import("./fields.js").Argument} Argument
 * @typedef {import("../widgets/cell.js").Doors} HostDoors
 * @typedef {Pick<HostDoors, "run" | "input" | "asks">} Doors
 * @typedef {import("../core/types.js").Value} Value
 * @typedef {() => Record<string, Value>} Given
 *
 * @typedef {object} Command
 * @property {string} name
 * @property {string} title
 * @property {string} description
 * @property {string} line
 * @property {number} steps
 * @property {boolean} isAnswered
 * @property {number} leaseMs 0 for a command without hold
 * @property {import("../control/shown_images.js").Sight | null} sees image that a held command requires
 * @property {import("../core/types.js").Question[]} asks
 * @property {string[]} requires
 * @property {(Argument & {description: string})[]} arguments
 */
import { t } from "urc/kit";
import { questionsOf } from "../control/confirm_dialog.js";
import { element, visible, wordsOf } from "./bytes.js";
import { button, field, valuesOf } from "./fields.js";

export class DebugCommands {
  /**
   * @param {HTMLElement} el
   * @param {HTMLElement} find
   * @param {Doors} doors
   * @param {AbortSignal} over
   */
  constructor(el, find, doors, over) {
    this.doors = doors;
    this.over = over;
    /** @type {Command[]} */
    const commands = JSON.parse(el.dataset["list"] ?? "[]");
    const rows = commands.map((command) => ({ el: this.row(command), words: wordsFor(command) }));
    el.replaceChildren(...rows.map((row) => row.el));
    find.addEventListener("input", () => {
      const wanted = find instanceof HTMLInputElement ? find.value.trim().toLowerCase() : "";
      for (const row of rows) row.el.hidden = !row.words.includes(wanted);
    });
  }

  /** @param {Command} command */
  row(command) {
    const el = element("details", "dev-command");
    el.dataset["command"] = command.name;
    const summary = element("summary", "");
    summary.append(element("span", "dbg-name", command.name), element("span", "dev-quiet", about(command)));
    el.append(summary);
    el.addEventListener("toggle", () => el.append(this.form(command)), { once: true });
    return el;
  }

  /** @param {Command} command */
  form(command) {
    const form = document.createElement("form");
    form.className = "dev-form";
    form.noValidate = true; // the server reports errors as text
    const fields = element("div", "dev-tools");
    const inputs = command.arguments.map((argument) => field(argument));
    fields.append(...inputs.map(({ label, argument }) => withHelp(label, argument)));
    const result = element("div", "dev-result");
    result.setAttribute("role", "status");
    const given = () => valuesOf(inputs);
    if (command.description) form.append(element("p", "dev-quiet", command.description));
    for (const text of command.requires) form.append(element("p", "dev-quiet", `◇ ${text}`));
    form.append(fields, command.leaseMs > 0 ? this.holdButton(command, given, result) : sendButton(), result);
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      if (command.leaseMs === 0) void this.run(command, given(), result);
    });
    return form;
  }

  /**
   * @param {Command} command
   * @param {Given} given
   * @param {HTMLElement} result
   */
  holdButton(command, given, result) {
    const el = button(t("Hold to move"), "button");
    el.setAttribute("aria-pressed", "false");
    const names = Object.fromEntries(command.arguments.map(({ name }) => [name, name]));
    const output = {
      command: command.name,
      names,
      fixed: {},
      ranges: {},
      neutral: {},
      line: command.line,
      refusal: "",
      isHeld: true,
      leaseMs: command.leaseMs,
      sees: command.sees,
      isAnswered: false,
      title: command.title,
      arguments: {},
      asks: [],
      steps: [],
    };
    this.doors.input.hold(
      output,
      {
        el,
        keys: ["Space", "Enter"],
        sample: given,
        show({ phase, reason }) {
          el.setAttribute("aria-pressed", String(phase === "held"));
          const text = phase === "spent" ? `▲ ${visible(reason)}` : phase === "held" ? `● ${t("moving")}` : "";
          if (result.textContent !== text) result.textContent = text;
        },
      },
      this.over,
    );
    return el;
  }

  /**
   * @param {Command} command
   * @param {Record<string, Value>} values
   * @param {HTMLElement} result
   */
  async run(command, values, result) {
    const { asks, run } = this.doors;
    const questions = questionsOf(command.asks, values);
    result.replaceChildren();
    try {
      const ticket = questions.length ? await asks.ask(result, questions, this.over) : undefined;
      if (!ticket) result.replaceChildren(element("p", "dev-quiet", `… ${t("waiting for the robot")}`));
      const reply = await run(command.name, values, ticket).finally(() => ticket?.close());
      const done = command.isAnswered ? t("done") : t("sent; this command has no reply");
      const told = Object.entries(reply).map(([name, value]) => {
        return element("p", "", visible(`${name} = ${JSON.stringify(value)}`));
      });
      result.replaceChildren(element("p", "", `✓ ${done}`), ...told);
    } catch (error) {
      result.replaceChildren(element("p", "dev-bad", `▲ ${visible(wordsOf(error))}`));
    }
  }
}

function sendButton() {
  return button(t("Send"), "submit");
}

/**
 * @param {HTMLElement} label
 * @param {Argument & {description?: string}} argument
 */
function withHelp(label, { title, name, description }) {
  const help = [title && title.toLowerCase() !== name.toLowerCase() ? title : "", description ?? ""];
  const text = help.filter(Boolean).join(": ");
  if (text) label.append(element("span", "dbg-help", text));
  return label;
}

/** @param {Command} command */
function about(command) {
  const words = [command.title.toLowerCase() === command.name ? "" : command.title];
  if (command.steps > 0) words.push(t("{count} steps", { count: command.steps }));
  if (command.leaseMs > 0) words.push(t("held"));
  if (command.arguments.length > 0) words.push(`(${command.arguments.map(({ name }) => name).join(", ")})`);
  return words.filter(Boolean).join(" · ");
}

/** @param {Command} command */
function wordsFor({ name, title, description }) {
  return `${name} ${title} ${description}`.toLowerCase();
}
