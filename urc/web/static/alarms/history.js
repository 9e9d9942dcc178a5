// @ts-check
/**
 * A robot's alarm history: newest events first, with a search, and older events on demand.
 *
 * @typedef {import("./actions.js").AlarmEvent} AlarmEvent
 */
import { SIGNS } from "../core/alarm_signs.js";
import { reason } from "../core/api_client.js";
import { made } from "../core/dom.js";
import { t } from "../core/words.js";
import { write } from "../widgets/kit.js";
import { conditionText, EVENTS } from "./phrases.js";

const AT_ONCE = 50;
/** Typing pause before the search starts. */
const TYPING_MS = 300;

export class AlarmHistory {
  /** @param {(query: {text: string, before: number, last: number}) => Promise<{events: AlarmEvent[], has_more: boolean, fault: string, lost: number}>} load */
  constructor(load) {
    this.load = load;
    /** Number of the last request; responses to earlier requests are ignored. */
    this.round = 0;
    this.oldest = 0;
    /** @type {number | undefined} */
    this.typing = undefined;
    this.text = /** @type {HTMLInputElement} */ (
      made("input", {
        class: "urc-input", type: "search", maxlength: "200", "aria-label": t("Search the history"),
        placeholder: t("Search"), oninput: () => this.typed(),
      })
    );
    this.said = made("p", { class: "urc-alarm-note", role: "status" });
    this.list = made("ol", { class: "urc-alarm-events", "data-alarm-events": true });
    const older = () => void this.show(true);
    this.more = made("button", { class: "urc-button", type: "button", "data-alarm-older": true, hidden: true, onclick: older }, t("Older"));
    this.el = made("details", { class: "urc-alarm-history" }, made("summary", {}, t("History")), this.text, this.said, this.list, this.more);
    this.el.addEventListener("toggle", () => {
      if (this.el.hasAttribute("open")) void this.show(false);
    });
  }

  typed() {
    clearTimeout(this.typing);
    this.typing = window.setTimeout(() => void this.show(false), TYPING_MS);
  }

  /** Load the newest events again, if the history is open. */
  refresh() {
    if (this.el.hasAttribute("open") && this.oldest === 0) void this.show(false);
  }

  /** @param {boolean} isMore whether to add older events */
  async show(isMore) {
    this.round += 1;
    const mine = this.round;
    try {
      const query = { text: this.text.value.trim(), before: isMore ? this.oldest : 0, last: AT_ONCE };
      const { events, has_more, fault, lost } = await this.load(query);
      if (mine !== this.round) return;
      const rows = events.map(rowOf);
      if (isMore) this.list.append(...rows);
      else this.list.replaceChildren(...rows);
      this.oldest = events.at(-1)?.id ?? this.oldest;
      this.more.hidden = !has_more;
      const missing = lost > 0 ? t("{count} events could not be stored.", { count: lost }) : "";
      const empty = this.list.childElementCount === 0 ? t("No event.") : "";
      write(this.said, [fault && t("New events are not stored: {why}", { why: fault }), missing, empty].filter(Boolean).join(" "));
    } catch (error) {
      if (mine === this.round) write(this.said, `▲ ${reason(error)}`);
    }
  }
}

/** @param {AlarmEvent} event */
function rowOf(event) {
  const time = new Date(1000 * event.at);
  const day = time.toLocaleDateString([], { month: "2-digit", day: "2-digit" });
  const words = [
    event.title && `${event.title}: ${conditionText(event.condition)}`,
    t(EVENTS[event.kind] ?? event.kind),
    event.kind === "raised" && event.value,
    event.kind === "shelved" && t("until {time}", { time: new Date(1000 * event.until).toLocaleTimeString([], { hour12: false }) }),
    event.times > 1 && t("{count} times", { count: event.times }),
    event.who && t("by {name}", { name: event.who }),
  ];
  return made(
    "li",
    { class: "urc-alarm-event", "data-kind": event.kind },
    made("time", { datetime: time.toISOString() }, `${day} ${time.toLocaleTimeString([], { hour12: false })}`),
    made("span", { class: "urc-alarm-sign", "aria-hidden": "true" }, event.kind === "raised" ? SIGNS[event.priority] : ""),
    made("span", {}, words.filter(Boolean).join(" · ")),
  );
}
