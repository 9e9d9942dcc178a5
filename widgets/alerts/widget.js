// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Alert} Alert */
import { ALARMS, attribute, button, isStill, part, write } from "urc/kit";
import { Book } from "./book.js";
import { hush, say, tone } from "./voice.js";

const LOOK_EVERY_MS = 1000;
const FLASH_EVERY_MS = 700;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, signal, follow, memory, t }) {
    const root = part(el, ".alerts");
    const list = part(el, ".alerts-lines");
    const note = part(el, ".alerts-note");
    const said = part(el, ".alerts-said");
    const mute = el.querySelector(".alerts-mute");
    const shelveMs = 60_000 * Number(options["shelve_min"] ?? 10);
    const book = new Book(memory.read());
    /** @type {readonly Alert[]} */
    let alerts = [];
    let watched = { limited: 1, known: 0 }; // until the page reports it
    let isUp = false;
    let isMuted = false;

    function look() {
      // Before the first value no alert can end: acknowledgements stay.
      if (alerts.length === 0 && watched.limited > 0 && watched.known === 0) return show();
      const fresh = book.take(alerts, Date.now());
      if (fresh.length > 0) tell(fresh);
      memory.write(book.kept());
      show();
    }

    /** @param {Alert[]} fresh */
    function tell(fresh) {
      const words = fresh.map((alert) => wordsOf(alert));
      said.textContent = words.join(". ");
      if (isMuted) return;
      if (options["sound"] === true) tone(fresh.some(({ alarm }) => alarm === "lolo" || alarm === "hihi"));
      if (options["speech"] === true) say(words.join(". "));
    }

    /** @param {Alert} alert */
    function wordsOf({ title, alarm, text, unit, age }) {
      const word = t(ALARMS[alarm]).replace(/^[▲◆]\s*/, "");
      return [`${title}: ${word}`, `${text}${unit ? ` ${unit}` : ""}`, age && t("{age} old", { age })].filter(Boolean).join(", ");
    }

    function show() {
      const nowMs = Date.now();
      const old = new Map([...list.children].map((item) => [item.getAttribute("data-signal"), item]));
      const items = alerts.map((alert) => {
        const item = old.get(alert.signal) ?? itemOf(alert.signal);
        draw(item, alert, nowMs);
        return item;
      });
      const isSame = items.length === list.childElementCount && items.every((item, place) => list.children[place] === item);
      if (!isSame) list.replaceChildren(...items);
      const states = alerts.map(({ signal: name }) => book.state(name, nowMs));
      const count = states.filter((state) => state === "new").length;
      attribute(root, "data-loud", count > 0 ? "true" : "");
      const shelved = states.filter((state) => state === "shelved").length;
      const said = alerts.length === 0 ? [calm()] : [
        t("{count} not acknowledged", { count }),
        shelved > 0 ? t("{count} put off", { count: shelved }) : "",
      ];
      const words = [...said, unknown()].filter(Boolean).join(" · ");
      write(note, alerts.length === 0 ? `— ${words}` : words);
    }

    /** Text for no alert: all is well only if every limited signal has a value. */
    function calm() {
      const { limited, known } = watched;
      if (isUp && known === limited) return t("✓ no alert");
      return isUp && known > 0 ? t("no alert") : "";
    }

    /** Number of limited signals without a value. */
    function unknown() {
      const count = watched.limited - watched.known;
      if (!isUp) return t("no connection to URC");
      return count > 0 ? t("values not known now: {count} of {all}", { count, all: watched.limited }) : "";
    }

    /** @param {string} name */
    function itemOf(name) {
      const item = document.createElement("li");
      item.className = "alerts-line";
      item.dataset["signal"] = name;
      const words = document.createElement("span");
      words.className = "alerts-words";
      const more = document.createElement("span");
      more.className = "alerts-more";
      const seen = deed("alerts-seen urc-act", t("Acknowledge"), () => book.acknowledge(name));
      const later = deed("alerts-later urc-act", t("Put off {minutes} min", { minutes: shelveMs / 60_000 }), () =>
        book.shelve(name, Date.now() + shelveMs));
      item.append(words, more, seen, later);
      return item;
    }

    /**
     * @param {Element} item
     * @param {Alert} alert
     * @param {number} nowMs
     */
    function draw(item, alert, nowMs) {
      const state = book.state(alert.signal, nowMs);
      attribute(item, "data-alarm", alert.alarm);
      attribute(item, "data-is", state);
      attribute(item, "data-old", alert.age ? "true" : "");
      const value = `${alert.text}${alert.unit ? ` ${alert.unit}` : ""}`;
      const old = alert.age ? ` · ${t("{age} old", { age: alert.age })}` : "";
      write(part(item, ".alerts-words"), `${t(ALARMS[alert.alarm])} · ${alert.title}: ${value}${old}`);
      const leftMin = Math.ceil((book.untilMs(alert.signal) - nowMs) / 60_000);
      const words = { new: "", seen: t("✓ acknowledged"), shelved: t("put off for {minutes} min", { minutes: leftMin }) };
      write(part(item, ".alerts-more"), words[state]);
      part(item, ".alerts-seen").hidden = state !== "new";
      part(item, ".alerts-later").hidden = state === "shelved";
    }

    /**
     * @param {string} name
     * @param {string} text
     * @param {() => void} act
     */
    function deed(name, text, act) {
      const press = () => {
        act();
        hush();
        look();
      };
      return button(name, text, press, { signal });
    }

    mute?.addEventListener("click", () => {
      isMuted = !isMuted;
      if (isMuted) hush();
      attribute(mute, "aria-pressed", String(isMuted));
      write(mute, isMuted ? t("Unmute") : t("Mute"));
    }, { signal });
    follow("alarms", (news) => {
      alerts = news;
      look();
    });
    follow("watched", (news) => {
      watched = news;
      show();
    });
    follow("links", (news) => {
      isUp = news.isUp;
      show();
    });
    let isDim = false;
    const flash = setInterval(() => {
      isDim = !isDim && !isStill();
      attribute(root, "data-flash", isDim ? "true" : "");
    }, FLASH_EVERY_MS);
    const timer = setInterval(look, LOOK_EVERY_MS); // shelved alerts come back
    return {
      destroy() {
        clearInterval(timer);
        clearInterval(flash);
        hush();
      },
    };
  },
};
