// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { attribute, button, part, write } from "urc/kit";

const LATE_MS = 10_000;
const SHORTEST_S = 5;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const address = String(ctx.options["url"] ?? "");
    // The server replaces the page's URL by a URL of its own, but not without a robot, as in the gallery.
    if (!address.startsWith("/robots/")) return { update() {} };
    const shown = new Shown(ctx, address);
    return { update() {}, destroy: () => shown.end() };
  },
};

class Shown {
  /**
   * @param {Context} ctx
   * @param {string} address
   */
  constructor({ el, options, signal, t }, address) {
    this.t = t;
    this.address = address;
    this.root = part(el, ".iframe");
    this.place = part(el, ".iframe-place");
    this.note = part(el, ".iframe-note");
    this.title = part(el, ".iframe-title").textContent ?? "";
    this.fault = "";
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.late = undefined;
    this.addButton(part(el, ".iframe-top"), signal);
    // A third-party page does not report keys; the widget only detects its focus.
    for (const kind of ["blur", "focus"]) addEventListener(kind, () => this.tell(), { signal });
    const every = Number(options["refresh"] ?? 0);
    if (every > 0) this.timer = setInterval(() => this.refresh(), Math.max(every, SHORTEST_S) * 1000);
    this.load();
  }

  /**
   * @param {HTMLElement} top
   * @param {AbortSignal} signal
   */
  addButton(top, signal) {
    top.append(button("iframe-reload", "↻", () => this.load(), { signal, label: this.t("Load the page again") }));
  }

  isInside() {
    return document.activeElement instanceof HTMLIFrameElement && this.place.contains(document.activeElement);
  }

  refresh() {
    if (!document.hidden && !this.isInside()) this.load();
  }

  /** Load the page in a new frame, because a new URL in the same frame would add to the history. */
  load() {
    for (const old of this.place.querySelectorAll("[data-coming]")) old.remove();
    const frame = document.createElement("iframe");
    frame.className = "iframe-page";
    frame.title = this.title;
    frame.dataset["coming"] = "yes";
    frame.addEventListener("load", () => this.loaded(frame));
    frame.src = this.address;
    this.place.append(frame);
    clearTimeout(this.late);
    this.late = setTimeout(() => this.say("fault", this.silent()), LATE_MS);
    if (this.place.childElementCount === 1) this.say("wait", `… ${this.t("loading")}`);
  }

  silent() {
    return `◆ ${this.t("the page does not respond, or does not allow other pages to show it")}`;
  }

  /** @param {HTMLIFrameElement} frame */
  loaded(frame) {
    clearTimeout(this.late);
    for (const old of this.place.querySelectorAll("iframe")) if (old !== frame) old.remove();
    delete frame.dataset["coming"];
    // The document around the page is from URC; it is missing if the server refused the page.
    const ours = frame.contentDocument;
    const refused = ours?.body.dataset["fault"] ?? "";
    const isThere = ours?.querySelector("iframe") !== null && ours !== null;
    attribute(frame, "data-refused", isThere ? null : "yes");
    if (isThere) this.say("live", "");
    else this.say("fault", refused ? `◆ ${refused}` : this.silent());
  }

  /**
   * @param {"wait" | "live" | "fault"} state
   * @param {string} fault
   */
  say(state, fault) {
    attribute(this.root, "data-state", state);
    this.fault = fault;
    this.tell();
  }

  tell() {
    const isInside = this.isInside();
    attribute(this.root, "data-inside", isInside ? "yes" : null);
    const keys = isInside ? `▲ ${this.t("this page receives all keys, including Space: use STOP on the screen")}` : "";
    write(this.note, [this.fault, keys].filter(Boolean).join(" · "));
  }

  end() {
    clearTimeout(this.late);
    clearInterval(this.timer);
  }
}
