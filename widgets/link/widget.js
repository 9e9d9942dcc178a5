// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Lease} Lease */
/** @typedef {import("../../urc/web/static/core/types.js").Link} Link */
/** @typedef {import("../../urc/web/static/core/types.js").PendingValue} PendingValue */
import { attribute, DASH, part, write } from "urc/kit";
import { quality, Trips } from "./trips.js";

const WORST_FIRST = ["lost", "silent", "connecting", "idle", "live"];
const SIGNS = { good: "●", caution: "◆", bad: "▲", "": "◌" };
const STATES = { live: "●", silent: "◆", lost: "▲", connecting: "◌", idle: "○" };

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount({ el, signal, follow, drive, t }) {
    const root = part(el, ".link");
    const now = part(el, ".link-now");
    const facts = el.querySelector(".link-facts");
    const who = el.querySelector(".link-who");
    const verbs = el.querySelector(".link-verbs");
    const trips = new Trips();
    let isUp = false;
    /** @type {number | null} */
    let tripMs = null;
    let failures = 0;
    /** @type {number | null} */
    let skewMs = null;
    let messages = 0;
    let bytes = 0;
    /** Age of this page's input at the robot's site; null at the robot's own site. @type {number | null} */
    let inputMs = null;
    /** @type {readonly Link[]} */
    let links = [];
    let isReplay = false;
    /** Whether any link has been connected; a robot that was never reached is not lost. */
    let wasLive = false;
    /** Whether URC is reachable, but cannot open the robot. */
    let isRefused = false;
    let rate = { messages: NaN, bytes: NaN };
    let before = { ms: performance.now(), messages: -1, bytes: 0 };

    follow("latency", (news) => {
      ({ isUp, failures, skewMs, messages, bytes } = news);
      if (news.tripMs !== null && news.tripMs !== tripMs) trips.add(news.tripMs);
      tripMs = news.tripMs;
      inputMs = news.inputMs ?? null;
      show();
    });
    follow("links", (news) => {
      links = news.links;
      wasLive ||= links.some(({ state }) => state === "live" || state === "silent");
      isRefused = news.isRefused ?? false;
      isReplay = news.isReplay ?? false;
      show();
    });
    const timer = setInterval(() => {
      const ms = performance.now();
      const seconds = (ms - before.ms) / 1000;
      if (before.messages >= 0) {
        rate = { messages: (messages - before.messages) / seconds, bytes: (bytes - before.bytes) / seconds };
      }
      before = { ms, messages, bytes };
      show();
    }, 1000);

    function show() {
      const worst = WORST_FIRST.find((state) => links.some((link) => link.state === state));
      const grade = quality(tripMs);
      const sign = !isUp || worst === "lost" ? "bad" : worst === "silent" ? "caution" : worst === "live" ? grade || "good" : "";
      attribute(root, "data-state", sign);
      if (isReplay && worst === "live") {
        attribute(root, "data-state", "");
        write(now, t("Replay")); // a playback has no live link
        if (facts) draw(facts);
        return;
      }
      const words = !isUp
        ? isRefused ? t("Cannot open") : t("No connection to URC")
        : { lost: wasLive ? t("Robot lost") : t("Not connected"), silent: t("Robot silent"), live: t("Live") }[worst ?? ""] ?? t("Connecting");
      // Hidden for a lost robot: operators could mistake the trip to URC for the trip to the robot.
      const trip = tripMs === null || worst !== "live" ? "" : ` · ${figure(tripMs)} ms`;
      write(now, `${SIGNS[sign]} ${words}${trip}`);
      if (facts) draw(facts);
    }

    /** @param {Element} place */
    function draw(place) {
      const late = trips.late();
      /** @type {[string, string][]} */
      const rows = [
        [t("round trip"), tripMs === null ? DASH : `${figure(tripMs)} ms`],
        [t("median / 95 %"), trips.share(0.5) === null ? DASH : `${figure(trips.share(0.5))} / ${figure(trips.share(0.95))} ms`],
        [t("late"), late === null ? DASH : `${Math.round(100 * late)} %`],
        ...(inputMs === null ? [] : [/** @type {[string, string]} */ ([t("age of input"), `${figure(inputMs)} ms`])]),
        [t("messages"), Number.isFinite(rate.messages) ? `${Math.round(rate.messages)} /s` : DASH],
        [t("data"), Number.isFinite(rate.bytes) ? `${(rate.bytes / 1000).toFixed(1)} kB/s` : DASH],
        [t("failed attempts"), String(failures)],
        [t("clock offset to URC"), skewMs === null ? DASH : `${skewMs > 0 ? "+" : ""}${(skewMs / 1000).toFixed(1)} s`],
        ...links.map((link) => /** @type {[string, string]} */ ([link.transport, lineOf(link)])),
      ];
      if (place.childElementCount !== 2 * rows.length) {
        place.replaceChildren(...rows.flatMap(() => [document.createElement("dt"), document.createElement("dd")]));
      }
      rows.forEach(([name, value], row) => {
        const [dt, dd] = [place.children[2 * row], place.children[2 * row + 1]];
        if (dt) write(dt, name);
        if (dd) write(dd, value);
      });
    }

    /** @param {Link} link */
    function lineOf({ state, address, detail, faults, attempts }) {
      const words = { live: t("live"), silent: t("silent"), lost: t("lost"), connecting: t("connecting"), idle: t("idle") };
      return [
        `${STATES[state]} ${words[state]}`,
        address,
        detail,
        faults > 0 ? t("{count} faults", { count: faults }) : "",
        attempts > 0 ? t("{count} failed attempts", { count: attempts }) : "",
      ].filter(Boolean).join(" · ");
    }

    if (who instanceof HTMLElement && verbs) {
      const words = {
        take: t("Take control"), ask: t("Ask for control"), force: t("Take over"),
        yes: t("Hand over"), no: t("Keep"), leave: t("Release"), reset: t("Reset"),
      };
      const buttons = Object.entries(words).map(([wish, text]) => {
        const made = document.createElement("button");
        made.type = "button";
        made.className = "link-verb urc-act";
        made.textContent = text;
        made.hidden = true;
        made.addEventListener("click", () => drive(/** @type {PendingValue} */ (wish)), { signal });
        return { wish, made };
      });
      verbs.append(...buttons.map(({ made }) => made));
      follow("lease", ({ lease, isMine, refusal }) => {
        who.hidden = lease === null;
        const { text, wishes } = controlsOf(lease, isMine);
        write(who, refusal ? `◆ ${refusal}` : text);
        for (const { wish, made } of buttons) made.hidden = !wishes.includes(wish);
      });
    }

    /**
     * @param {Lease | null} lease
     * @param {boolean} isMine
     * @returns {{text: string, wishes: string[]}}
     */
    function controlsOf(lease, isMine) {
      if (!lease) return { text: "", wishes: [] };
      const { holder, asker, latched, drives, forces, you } = lease;
      if (latched) return { text: t("■ Stopped by {who}", { who: latched }), wishes: drives ? ["reset"] : [] };
      if (isMine && asker) return { text: t("◆ {who} asks to drive", { who: asker.name }), wishes: ["yes", "no"] };
      if (isMine) return { text: t("● You drive"), wishes: ["leave"] };
      if (!holder) return { text: t("No one drives"), wishes: drives ? ["take"] : [] };
      const text = asker?.id === you ? t("Asked {who}", { who: holder.name }) : t("{who} is driving", { who: holder.name });
      return { text, wishes: drives ? [...(asker ? [] : ["ask"]), ...(forces ? ["force"] : [])] : [] };
    }

    return {
      destroy() {
        clearInterval(timer);
      },
    };
  },
};

/** @param {number | null} ms */
function figure(ms) {
  return String(Math.max(1, Math.round(ms ?? 0)));
}
