// @ts-check
/** The output: a terminal if one is installed, otherwise a plain list. */

/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("@xterm/xterm").Terminal} Terminal */

import { attribute } from "urc/kit";

const HIDE_CURSOR = "\x1b[?25l";

export class Screen {
  /**
   * @param {Context} ctx
   * @param {HTMLElement} place
   */
  constructor(ctx, place) {
    this.ctx = ctx;
    this.place = place;
    this.most = Number(ctx.options["lines"] ?? 1000);
    /** Lines before the terminal has loaded; also the text for screen readers. */
    this.list = document.createElement("ol");
    this.list.className = "terminal-list";
    /** @type {Terminal | null} */
    this.terminal = null;
    /** @type {(() => void) | null} */
    this.fit = null;
    place.append(this.list);
    this.isBlank = true;
    attribute(place, "aria-busy", "true");
    void this.load().finally(() => attribute(place, "aria-busy", null));
  }

  async load() {
    const { ctx, place } = this;
    try {
      const [{ Terminal: Made }, { FitAddon }] = await Promise.all([
        import("@xterm/xterm"),
        import("@xterm/addon-fit"),
        ctx.style("@xterm/xterm"),
      ]);
      if (ctx.signal.aborted) return;
      const terminal = new Made({
        disableStdin: true,
        convertEol: true,
        scrollback: this.most,
        screenReaderMode: true,
        fontSize: Number(ctx.options["font_size"] ?? 14),
        fontFamily: "ui-monospace, 'Liberation Mono', monospace",
      });
      const fitting = new FitAddon();
      terminal.loadAddon(fitting);
      const box = document.createElement("div");
      box.className = "terminal-box";
      place.append(box);
      withNonce(() => terminal.open(box));
      // Read-only: Tab leaves the terminal, Escape is STOP, and the focus stays on the output around it.
      terminal.attachCustomKeyEventHandler(({ key }) => key.startsWith("Page"));
      for (const part of [terminal.element, terminal.textarea]) if (part) part.tabIndex = -1;
      terminal.write(HIDE_CURSOR); // there is no input here
      for (const line of this.list.children) this.print(terminal, line.textContent ?? "");
      this.list.classList.add("urc-hidden"); // still readable by screen readers and tests
      this.terminal = terminal;
      this.fit = () => fitting.fit();
      this.fit();
      this.paint();
      ctx.signal.addEventListener("abort", () => terminal.dispose());
      ctx.follow("theme", () => this.paint());
    } catch (error) {
      // The list shows the same lines; some installations lack the terminal.
      console.info("terminal: a plain list instead:", error);
    }
  }

  paint() {
    if (!this.terminal) return;
    const look = getComputedStyle(this.list);
    this.terminal.options.theme = {
      background: look.backgroundColor,
      foreground: look.color,
      cursor: look.color,
    };
  }

  /**
   * Print a line break and then a line; otherwise, a terminal of one row would show an empty row.
   *
   * @param {Terminal} terminal
   * @param {string} line
   */
  print(terminal, line) {
    terminal.write(this.isBlank ? line : `\n${line}`);
    this.isBlank = false;
  }

  /** @param {string} line without control characters */
  write(line) {
    const item = document.createElement("li");
    item.textContent = line;
    const isAtEnd = this.place.scrollHeight - this.place.scrollTop - this.place.clientHeight < 24;
    this.list.append(item);
    while (this.list.childElementCount > Math.min(this.most, 500)) this.list.firstElementChild?.remove();
    if (this.terminal) this.print(this.terminal, line);
    else if (isAtEnd) this.place.scrollTop = this.place.scrollHeight;
  }
}

/**
 * Allow new style elements under the page policy: the terminal creates some, and has no nonce option.
 *
 * @param {() => void} act must be synchronous
 */
function withNonce(act) {
  const script = document.querySelector("script[nonce]");
  const nonce = script instanceof HTMLScriptElement ? script.nonce : "";
  const make = document.createElement.bind(document);
  /** @param {string} name @param {ElementCreationOptions} [options] */
  function made(name, options) {
    const el = make(name, options);
    if (el instanceof HTMLStyleElement) el.nonce = nonce;
    return el;
  }
  Object.defineProperty(document, "createElement", { value: made, configurable: true });
  try {
    act();
  } finally {
    Reflect.deleteProperty(document, "createElement"); // restores the original
  }
}
