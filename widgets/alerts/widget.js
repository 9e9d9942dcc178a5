// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Alert} Alert */
import { ALARMS, SIGNS, attribute, button, part, write } from "urc/kit";
import { hush, say } from "./voice.js";

/** Maximum number of drawn alarms; the widget only counts the others. */
const MOST_SHOWN = 50;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, options, signal, follow, alarms, t }) {
    const root = part(el, ".alerts");
    const list = part(el, ".alerts-lines");
    const note = part(el, ".alerts-note");
    const mute = el.querySelector(".alerts-mute");
    const shelveMin = Number(options["shelve_min"] ?? 10);
    /** @type {readonly Alert[]} */
    let alerts = [];
    /** Spoken alarms, by signal. @type {Map<string, number>} */
    const spoken = new Map();
    let watched = { limited: 1, known: 0 }; // until the page reports it
    let isUp = false;
    let isRefused = false;
    let isMuted = false;

    function look() {
      const fresh = alerts.filter(({ signal: name, state, raised }) => state === "unacknowledged" && spoken.get(name) !== raised);
      for (const { signal: name, raised } of fresh) spoken.set(name, raised);
      if (fresh.length > 0 && options["speech"] === true && !isMuted) say(spokenOf(fresh));
      show();
    }

    /** @param {Alert[]} fresh */
    function spokenOf(fresh) {
      const words = fresh.slice(0, 3).map((alert) => `${alert.title}: ${wordOf(alert)}`);
      const more = fresh.length > 3 ? [moreAlarms(fresh.length - 3)] : [];
      return [...words, ...more].join(". ");
    }

    /** @param {number} count */
    function moreAlarms(count) {
      return count === 1 ? t("1 more alarm") : t("{count} more alarms", { count });
    }

    /** @param {Alert} alert */
    function wordOf({ alarm, condition }) {
      return alarm === "major" || alarm === "minor" ? condition : t(ALARMS[alarm]);
    }

    function show() {
      const shown = alerts.slice(0, MOST_SHOWN);
      const old = new Map([...list.children].map((item) => [item.getAttribute("data-signal"), item]));
      const items = shown.map((alert) => {
        const item = old.get(alert.signal) ?? itemOf(alert.signal);
        draw(item, alert);
        return item;
      });
      const isSame = items.length === list.childElementCount && items.every((item, place) => list.children[place] === item);
      if (!isSame) list.replaceChildren(...items);
      const count = alerts.filter(isWaiting).length;
      attribute(root, "data-loud", count > 0 ? "true" : "");
      const shelved = alerts.filter(({ state }) => state === "shelved").length;
      const left = alerts.length - shown.length;
      const said = alerts.length === 0 ? [calm()] : [
        t("{count} not acknowledged", { count }),
        shelved > 0 ? t("{count} shelved", { count: shelved }) : "",
        left > 0 ? moreAlarms(left) : "",
      ];
      const words = [...said, unknown()].filter(Boolean).join(" · ");
      write(note, alerts.length === 0 ? `— ${words}` : words);
    }

    /** Text without an alert: “all is well” requires a value of every signal with limits. */
    function calm() {
      const { limited, known } = watched;
      if (isUp && known === limited) return t("✓ no alert");
      return isUp && known > 0 ? t("no alert") : "";
    }

    /** Number of signals with limits but without a value. */
    function unknown() {
      const count = watched.limited - watched.known;
      if (!isUp) return isRefused ? t("not connected to the robot") : t("no connection to URC");
      return count > 0 ? t("unknown values: {count} of {all}", { count, all: watched.limited }) : "";
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
      const act = (/** @type {(alert: Alert) => void} */ deed) => () => {
        const alert = alerts.find((one) => one.signal === name);
        if (alert) deed(alert);
        hush();
      };
      const seen = button("alerts-seen urc-act", t("Acknowledge"), act((alert) => alarms.acknowledge([alert])), { signal });
      const shelve = act((alert) => alarms.shelve(alert, shelveMin));
      const later = button("alerts-later urc-act", t("Shelve {minutes} min", { minutes: shelveMin }), shelve, { signal });
      item.append(words, more, seen, later);
      return item;
    }

    /**
     * @param {Element} item
     * @param {Alert} alert
     */
    function draw(item, alert) {
      attribute(item, "data-alarm", alert.isActive ? alert.alarm : "");
      attribute(item, "data-is", alert.state);
      attribute(item, "data-old", alert.age || !alert.isKnown ? "true" : "");
      const isState = alert.alarm === "major" || alert.alarm === "minor";
      const value = isState ? "" : `: ${alert.text}${alert.unit ? ` ${alert.unit}` : ""}`;
      const old = alert.age ? ` · ${t("{age} old", { age: alert.age })}` : "";
      write(part(item, ".alerts-words"), `${alert.isActive ? `${SIGNS[alert.priority]} ${wordOf(alert)}` : "✓"} · ${alert.title}${value}${old}`);
      const name = alert.who;
      const states = {
        unacknowledged: alert.action,
        acknowledged: name ? t("✓ acknowledged by {name}", { name }) : t("✓ acknowledged"),
        returned: t("back to normal, not acknowledged"),
        shelved: t("shelved for {minutes} min", { minutes: Math.ceil(alert.leftS / 60) }),
        suppressed: t("suppressed by design"),
      };
      write(part(item, ".alerts-more"), states[alert.state] ?? "");
      const mayAct = alarms.may();
      part(item, ".alerts-seen").hidden = !mayAct || !isWaiting(alert);
      part(item, ".alerts-later").hidden = !mayAct || alert.state === "shelved" || alert.state === "suppressed";
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
      isRefused = news.isRefused ?? false;
      show();
    });
    follow("lease", show); // the lease determines the rights
    return { destroy: hush };
  },
};

/** @param {Alert} alert */
function isWaiting({ state }) {
  return state === "unacknowledged" || state === "returned";
}
