// @ts-check
/**
 * Choice of a place or a route, with a confirmation. Independent of Leaflet: a listener draws the choice.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Context} Context
 * @typedef {import("./geo.js").Place} Place
 * @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet
 */
import { attribute, button, write } from "urc/kit";
import { distance, distanceText, isInside, lengthOf, placeText } from "./geo.js";

/** Maximum number of places of a route; a longer route is not drawn by hand. */
const MOST = 200;

export class Choice {
  /**
   * @param {HTMLElement} root
   * @param {Pick<Context, "t" | "send" | "signal">} ctx
   * @param {{isLocal: boolean, form: "decimal" | "dms", fence: readonly Place[], changed: () => void}} given
   */
  constructor(root, { t, send, signal }, { isLocal, form, fence, changed }) {
    this.t = t;
    this.send = send;
    this.isLocal = isLocal;
    this.form = form;
    this.fence = fence;
    this.changed = changed;
    /** @type {"look" | "place" | "way" | "sure"} */
    this.mode = "look";
    /** @type {Place[]} */
    this.places = [];
    /** @type {Place | null} */
    this.robot = null;
    this.outcome = "";
    this.isBusy = false;
    /** @type {Outlet | undefined} */
    this.goto = undefined;
    /** @type {Outlet | undefined} */
    this.waypoints = undefined;
    this.bar = document.createElement("div");
    this.bar.className = "map-bar";
    this.bar.setAttribute("role", "group");
    this.bar.setAttribute("aria-label", t("Choose a place"));
    this.words = document.createElement("p");
    this.words.className = "map-words";
    this.words.setAttribute("role", "status");
    this.no = this.button(t("Cancel"), () => this.clear(), signal);
    this.undo = this.button(t("Undo"), () => this.back(), signal);
    this.yes = this.button("", () => void this.go(), signal);
    this.yes.classList.add("map-yes");
    this.bar.append(this.words, this.no, this.undo, this.yes);
    root.append(this.bar);
    this.show();
  }

  /**
   * @param {string} text
   * @param {() => void} press
   * @param {AbortSignal} signal
   */
  button(text, press, signal) {
    return button("map-button", text, press, { signal });
  }

  /**
   * @param {Outlet | undefined} goto
   * @param {Outlet | undefined} waypoints
   * @param {Place | null} robot
   */
  update(goto, waypoints, robot) {
    this.goto = goto;
    this.waypoints = waypoints;
    this.robot = robot;
    this.show();
  }

  /** @param {Place} place */
  tap(place) {
    if (this.isBusy) return;
    this.outcome = "";
    if (this.mode === "way") {
      if (this.places.length < MOST) this.places.push(place);
    } else if (this.goto && this.mode !== "sure") {
      this.mode = "place";
      this.places = [place];
    }
    this.show();
    this.changed();
  }

  /** Start or end the drawing of a route. */
  toggleWay() {
    const isWay = this.mode === "way" || this.mode === "sure";
    this.clear();
    if (!isWay) this.mode = "way";
    this.show();
  }

  back() {
    if (this.mode === "sure") this.mode = "way";
    else this.places.pop();
    this.show();
    this.changed();
  }

  clear() {
    this.mode = "look";
    this.places = [];
    this.outcome = "";
    this.show();
    this.changed();
  }

  /** Return the reason why the choice cannot be sent, or "". */
  hindrance() {
    const outlet = this.mode === "place" ? this.goto : this.waypoints;
    if (this.places.some((place) => !isInside(place, this.fence))) return this.t("outside the fence");
    return outlet?.reason ?? "";
  }

  show() {
    const { mode, places, t } = this;
    const isWay = mode === "way" || mode === "sure";
    attribute(this.bar, "hidden", mode === "look" && !this.outcome ? "" : null);
    attribute(this.no, "hidden", mode === "look" ? "" : null);
    attribute(this.undo, "hidden", isWay ? null : "");
    attribute(this.undo, "disabled", places.length === 0 || this.isBusy ? "" : null);
    attribute(this.yes, "hidden", mode === "look" ? "" : null);
    attribute(this.no, "disabled", this.isBusy ? "" : null);
    const reason = mode === "look" ? "" : this.hindrance();
    const isShort = mode === "way" ? places.length < 2 : places.length < 1;
    attribute(this.yes, "disabled", reason !== "" || isShort || this.isBusy ? "" : null);
    write(this.yes, mode === "way" ? t("Send …") : mode === "sure" ? t("Send") : t("Go there"));
    attribute(this.bar, "data-mode", mode);
    const text = reason && places.length > 0 ? `▲ ${reason}` : this.question();
    write(this.words, this.outcome || text);
  }

  question() {
    const { mode, places, t, isLocal, robot } = this;
    const [place] = places;
    if (mode === "place" && place) {
      const question = t("Go to {place}?", { place: placeText(place, this.form, isLocal) });
      if (!robot) return question;
      const way = distanceText(distance(robot, place, isLocal));
      return [question, t("{distance} away", { distance: way })].join(" · ");
    }
    const names = { count: places.length, length: distanceText(lengthOf(places, isLocal)) };
    if (mode === "sure") return t("Send the robot to {count} places in order ({length})?", names);
    if (mode !== "way") return "";
    return places.length === 0 ? t("Tap the places in order.") : t("{count} places, {length}", names);
  }

  async go() {
    if (this.yes.disabled) return;
    if (this.mode === "way") {
      this.mode = "sure"; // a route needs a second confirmation
      this.show();
      return;
    }
    const isPlace = this.mode === "place";
    this.isBusy = true;
    this.outcome = `… ${this.t("sending")}`;
    this.show();
    try {
      await this.send(isPlace ? "goto" : "waypoints", isPlace ? this.one() : this.all());
      this.clear();
      this.outcome = `✓ ${this.t("sent")}`;
    } catch (error) {
      this.outcome = `▲ ${error instanceof Error ? error.message : error}`;
    } finally {
      this.isBusy = false;
      this.show();
    }
  }

  one() {
    const [first, second] = rounded(this.places[0] ?? [0, 0], this.isLocal);
    return this.isLocal ? { x: second, y: first } : { latitude: first, longitude: second };
  }

  /** @returns {any} lists, for commands with array arguments */
  all() {
    const places = this.places.map((place) => rounded(place, this.isLocal));
    const [firsts, seconds] = [places.map(([first]) => first), places.map(([, second]) => second)];
    return this.isLocal ? { xs: seconds, ys: firsts } : { latitudes: firsts, longitudes: seconds };
  }
}

/**
 * Round to a millimetre, or to a centimetre on the Earth.
 *
 * @param {Place} place
 * @param {boolean} isLocal
 * @returns {Place}
 */
function rounded([first, second], isLocal) {
  const factor = isLocal ? 1e3 : 1e7;
  return [Math.round(first * factor) / factor, Math.round(second * factor) / factor];
}
