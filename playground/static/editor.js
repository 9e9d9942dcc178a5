// @ts-check
/**
 * An editor for one document: line numbers, marks under problems, and the report of the check.
 *
 * @typedef {import("./checks.js").Report} Report
 * @typedef {import("./checks.js").Problem} Problem
 */
import { check, summary } from "./checks.js";
import { fragmentOf } from "./text_link.js";

/** Pause in typing after which a check starts. */
const PAUSE_MS = 400;

export class Editor {
  /**
   * @param {HTMLElement} el emptied and filled by the editor
   * @param {object} spec
   * @param {string} spec.text
   * @param {string} spec.label name of the text for screen readers
   * @param {string} spec.page URL of the page to which links lead, without a fragment
   * @param {(text: string, report: Report) => void} [spec.onChecked]
   */
  constructor(el, { text, label, page, onChecked = () => {} }) {
    this.page = page;
    this.onChecked = onChecked;
    this.round = 0;
    /** @type {number | undefined} */
    this.pause = undefined;
    el.classList.add("urc-editor");
    el.innerHTML = `
      <div class="urc-editor-text">
        <pre class="urc-editor-numbers" aria-hidden="true"></pre>
        <div class="urc-editor-sheet">
          <pre class="urc-editor-marks" aria-hidden="true"></pre>
          <textarea spellcheck="false" autocapitalize="off" autocomplete="off" wrap="off"></textarea>
        </div>
      </div>
      <div class="urc-editor-bar">
        <p class="urc-editor-summary" role="status"></p>
        <button type="button" class="urc-editor-link">Copy link</button>
      </div>
      <ol class="urc-editor-problems"></ol>`;
    const find = (/** @type {string} */ name) => /** @type {HTMLElement} */ (el.querySelector(name));
    this.area = /** @type {HTMLTextAreaElement} */ (find("textarea"));
    this.numbers = find(".urc-editor-numbers");
    this.marks = find(".urc-editor-marks");
    this.summary = find(".urc-editor-summary");
    this.list = find(".urc-editor-problems");
    this.scroller = find(".urc-editor-text");
    this.area.setAttribute("aria-label", label);
    this.area.addEventListener("input", () => this.changed());
    find(".urc-editor-link").addEventListener("click", () => void this.copyLink());
    this.text = text;
  }

  get text() {
    return this.area.value;
  }

  set text(text) {
    this.area.value = text;
    this.laidOut();
    this.mark([]);
  }

  changed() {
    this.laidOut();
    this.mark([]);
    clearTimeout(this.pause);
    this.pause = window.setTimeout(() => void this.check(), PAUSE_MS);
  }

  /** Let the text area be as large as its text, so that only its frame scrolls. */
  laidOut() {
    const lines = this.text.split("\n");
    this.numbers.textContent = lines.map((_, index) => index + 1).join("\n");
    this.area.rows = lines.length;
    this.area.cols = Math.max(20, ...lines.map((line) => line.length + 1));
  }

  /** Check the text; the newest check wins. */
  async check() {
    clearTimeout(this.pause);
    this.round += 1;
    const { round, text } = this;
    this.tell("Checking…", "");
    try {
      const report = await check(text, (step) => round === this.round && this.tell(step, ""));
      if (round !== this.round || text !== this.text) return;
      this.show(report);
      this.onChecked(text, report);
    } catch (error) {
      if (round !== this.round) return;
      this.tell(`The check failed: ${error instanceof Error ? error.message : error}`, "error");
    }
  }

  /**
   * @param {string} text
   * @param {"" | "good" | "warning" | "error"} state
   */
  tell(text, state) {
    this.summary.textContent = text;
    this.summary.dataset["state"] = state;
  }

  /** @param {Report} report */
  show(report) {
    this.tell(summary(report), report.errors ? "error" : report.warnings ? "warning" : "good");
    this.mark(report.problems);
    this.list.replaceChildren(...report.problems.map((one) => this.item(one)));
  }

  /** @param {Problem} problem */
  item(problem) {
    const item = document.createElement("li");
    const button = document.createElement("button");
    button.type = "button";
    item.dataset["severity"] = problem.severity;
    const sign = document.createElement("span");
    sign.className = "urc-editor-sign";
    sign.textContent = problem.severity === "error" ? "▲" : "◆";
    sign.setAttribute("aria-hidden", "true");
    const place = document.createElement("span");
    place.className = "urc-editor-place";
    place.textContent = `line ${problem.line}, column ${problem.column}`;
    const code = document.createElement("code");
    code.textContent = problem.code;
    const said = document.createElement("span");
    said.textContent = problem.message;
    button.append(sign, place, ` ${problem.severity} `, code, " ", said);
    button.addEventListener("click", () => this.select(problem));
    item.append(button);
    if (problem.hint) {
      const hint = document.createElement("p");
      hint.textContent = problem.hint;
      item.append(hint);
    }
    return item;
  }

  /** @param {Problem[]} problems */
  mark(problems) {
    if (problems.length === 0) this.list.replaceChildren();
    const pieces = [];
    let at = 0;
    for (const { start, end, severity } of this.spans(problems)) {
      if (start < at) continue; // two problems of one place: the first one is marked
      const mark = document.createElement("mark");
      mark.dataset["severity"] = severity;
      mark.textContent = this.text.slice(start, end);
      pieces.push(this.text.slice(at, start), mark);
      at = end;
    }
    // A line break at the end adds no line here, but one to the text area.
    this.marks.replaceChildren(...pieces, `${this.text.slice(at)}\n`);
  }

  /** @param {Problem[]} problems */
  spans(problems) {
    const starts = [0];
    for (let at = this.text.indexOf("\n"); at >= 0; at = this.text.indexOf("\n", at + 1)) starts.push(at + 1);
    return problems
      .map((one) => {
        const line = starts[one.line - 1] ?? this.text.length;
        const start = line + offsetOf(this.text.slice(line), one.column - 1);
        const end = line + offsetOf(this.text.slice(line), (one.end_column || one.column + 1) - 1);
        return { start, end: Math.max(end, start + 1), severity: one.severity };
      })
      .sort((one, other) => one.start - other.start);
  }

  /** @param {Problem} problem */
  select(problem) {
    const [span] = this.spans([problem]);
    if (!span) return;
    this.area.focus({ preventScroll: true });
    this.area.setSelectionRange(span.start, span.end);
    const height = this.area.offsetHeight / Math.max(1, this.area.rows);
    this.scroller.scrollTo({ top: (problem.line - 3) * height });
  }

  async copyLink() {
    const link = this.page + (await fragmentOf(this.text));
    try {
      await navigator.clipboard.writeText(link);
      this.tell("The link is in the clipboard. It contains the whole text.", "good");
    } catch {
      prompt("Copy this link; it contains the whole text:", link);
    }
  }
}

/**
 * Characters of Python count code points; a text area counts UTF-16 units.
 *
 * @param {string} text
 * @param {number} points
 */
function offsetOf(text, points) {
  let at = 0;
  for (let left = points; left > 0 && at < text.length; left -= 1) {
    at += (text.codePointAt(at) ?? 0) > 0xffff ? 2 : 1;
  }
  return at;
}
