// @ts-check
/**
 * The try-out of the parser. The module uses no socket.
 *
 * @typedef {import("./commands.js").Desk} Desk
 * @typedef {{name: string, type: string, framing: string, encoding: string, messages: boolean}} Line
 * @typedef {{kind: string, names: string[], fields: Record<string, string>,
 *   samples: [string, string, string][], refused: string[]}} Taker
 * @typedef {{start: number, end: number, data: string, fault: string, takers: Taker[],
 *   reasons: string[]}} Piece
 * @typedef {{error: string, size: number, left: number, more: number, pieces: Piece[]}} Tried
 */
import { part } from "../live/badge.js";
import { bytesOf, element, hexOf, listElement, sizeText, textOf, visible, wordsOf } from "./bytes.js";

/** @type {Record<string, string>} */
const TAKERS = {
  message: "✓ taken by",
  reply: "✓ would answer, as",
  refusal: "▲ would be a refusal, as",
};

export class TryOut {
  /**
   * @param {ParentNode} root
   * @param {Desk} desk
   */
  constructor(root, desk) {
    this.form = /** @type {HTMLFormElement} */ (part(root, "[data-try]"));
    this.topic = part(root, "[data-topic]");
    this.result = part(root, "[data-tried]");
    this.desk = desk;
    /** @type {Line[]} */
    this.lines = [];
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      void this.submit();
    });
    this.form.addEventListener("change", () => this.follow());
    this.form.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && (event.ctrlKey || event.metaKey)) this.form.requestSubmit();
    });
  }

  /** @param {Line[]} lines */
  setLines(lines) {
    this.lines = lines;
    const select = this.form.elements.namedItem("transport");
    if (!(select instanceof HTMLSelectElement)) return;
    const chosen = select.value;
    select.replaceChildren(...lines.map(({ name, type }) => new Option(`${name} (${type})`, name)));
    if (lines.some((line) => line.name === chosen)) select.value = chosen;
    this.follow();
  }

  /** @returns {Line | undefined} */
  get line() {
    const name = new FormData(this.form).get("transport");
    return this.lines.find((line) => line.name === name);
  }

  follow() {
    this.topic.hidden = !this.line?.messages;
  }

  async submit() {
    const given = new FormData(this.form);
    const line = this.line;
    if (!line) return;
    const message = {
      t: "try",
      transport: line.name,
      text: String(given.get("text") ?? "").replaceAll("\r\n", "\n"),
      hex: given.get("form") === "hex",
      topic: line.messages ? String(given.get("topic") ?? "").trim() : "",
    };
    try {
      this.result.replaceChildren(...triedElements(await this.desk.ask(message), line));
    } catch (error) {
      this.result.replaceChildren(element("p", "dev-bad", `▲ ${wordsOf(error)}`));
    }
  }
}

/**
 * @param {Tried} tried
 * @param {Line} line
 */
function triedElements(tried, line) {
  if (tried.error) return [element("p", "dev-bad", `▲ ${tried.error}`)];
  const frames = tried.pieces.filter((piece) => !piece.fault).length;
  const how = line.messages ? "one message" : `${frames} frame${frames === 1 ? "" : "s"} by ${line.framing}`;
  const found = [element("p", "", `${sizeText(tried.size)}: ${how}`)];
  found.push(...tried.pieces.map((piece) => pieceElement(piece, line)));
  if (tried.left > 0) {
    const text = `◆ ${sizeText(tried.left)} at the end begin a frame and do not end it`;
    found.push(element("p", "dev-caution", text));
  }
  if (tried.more > 0) found.push(element("p", "dev-caution", `◆ ${tried.more} more frames were not looked at`));
  return found;
}

/**
 * @param {Piece} piece
 * @param {Line} line
 */
function pieceElement(piece, line) {
  const el = element("div", "dev-piece");
  const bytes = bytesOf(piece.data);
  const place = line.messages ? "" : `bytes ${piece.start} to ${piece.end}: `;
  el.append(element("p", "", `${place}${textOf(bytes, line.encoding)}`));
  el.append(element("p", "dev-hex", hexOf(bytes)));
  if (piece.fault) el.append(element("p", "dev-bad", `▲ no frame: ${visible(piece.fault)}`));
  for (const taker of piece.takers) el.append(takerElement(taker));
  if (piece.reasons.length > 0) {
    el.append(element("p", "dev-caution", "◆ nobody takes it"), listElement(piece.reasons));
  }
  return el;
}

/** @param {Taker} taker */
function takerElement(taker) {
  const el = element("div", taker.kind === "refusal" ? "dev-caution" : "");
  el.append(element("p", "", `${TAKERS[taker.kind] ?? taker.kind} ${taker.names.join(", ")}`));
  const fields = Object.entries(taker.fields).map(([name, value]) => `field ${name} = ${value}`);
  const signals = taker.samples.map(
    ([name, value, alarm]) => `signal ${name} = ${value}${alarm ? ` (alarm: ${alarm})` : ""}`,
  );
  const refused = taker.refused.map((text) => `▲ ${text}`);
  const all = [...fields, ...signals, ...refused];
  if (all.length > 0) el.append(listElement(all));
  return el;
}
