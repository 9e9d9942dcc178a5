// @ts-check
/**
 * Choice of a place or a route, with a confirmation. Independent of Leaflet: a listener draws the choice.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Context} Context
 * @typedef {import("./geo.js").Place} Place
 * @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet
 */
import { attribute, button, write } from "urc/kit";
import { distance, distanceText, isInside, lengthOf, placeText, wrapped } from "./geo.js";

/** Maximum number of places of a route; a longer route is not drawn by hand. */
const MOST = 200;
/** Time after which a command counts as one that takes long, such as a goal, in milliseconds. */
const SOON_MS = 1000;
/** Turn of one press, in radians. */
const STEP = Math.PI / 12;

export class Choice {
  /**
   * @param {HTMLElement} root
   * @param {Pick<Context, "t" | "send" | "signal">} ctx
   * @param {{isLocal: boolean, form: "decimal" | "dms", fence: readonly Place[], changed: () => void, turns: ReadonlySet<string>}} given
   *   `turns` are the outputs that take a direction.
   */
  constructor(root, { t, send, signal }, { isLocal, form, fence, changed, turns }) {
    this.t = t;
    this.send = send;
    this.isLocal = isLocal;
    this.form = form;
    this.fence = fence;
    this.changed = changed;
    this.turns = turns;
    /** Output that a place is for. @type {"goto" | "initial_pose"} */
    this.target = "goto";
    /** Output that the next gesture is for; "" while a gesture moves the map. @type {"" | "goto" | "initial_pose"} */
    this.aiming = "";
    /** Direction at the place, in radians counter-clockwise. @type {number | null} */
    this.yaw = null;
    /** Direction of the robot. @type {number | null} */
    this.robotYaw = null;
    /** @type {"look" | "place" | "way" | "sure"} */
    this.mode = "look";
    /** @type {Place[]} */
    this.places = [];
    /** @type {Place | null} */
    this.robot = null;
    this.outcome = "";
    this.isBusy = false;
    /** Number of sent commands. */
    this.sent = 0;
    /** @type {Outlet | undefined} */
    this.goto = undefined;
    /** @type {Outlet | undefined} */
    this.waypoints = undefined;
    /** @type {Outlet | undefined} */
    this.pose = undefined;
    this.bar = document.createElement("div");
    this.bar.className = "map-bar";
    this.bar.setAttribute("role", "group");
    this.bar.setAttribute("aria-label", t("Choose a place"));
    this.words = document.createElement("p");
    this.words.className = "map-words";
    this.words.setAttribute("role", "status");
    this.no = this.button(t("Cancel"), () => this.clear(), signal);
    this.undo = this.button(t("Undo"), () => this.back(), signal);
    this.left = this.button("↺", () => this.turn(STEP), signal, t("Turn left by 15°"));
    this.right = this.button("↻", () => this.turn(-STEP), signal, t("Turn right by 15°"));
    this.yes = this.button("", () => void this.go(), signal);
    this.yes.classList.add("map-yes");
    this.bar.append(this.words, this.no, this.undo, this.left, this.right, this.yes);
    root.append(this.bar);
    this.show();
  }

  /**
   * @param {string} text
   * @param {() => void} press
   * @param {AbortSignal} signal
   * @param {string} [label]
   */
  button(text, press, signal, label) {
    return button("map-button", text, press, label ? { signal, label } : { signal });
  }

  /**
   * @param {Readonly<Record<string, Outlet>>} outputs
   * @param {Place | null} robot
   * @param {number | null} yaw direction of the robot
   */
  update(outputs, robot, yaw) {
    this.goto = outputs["goto"];
    this.waypoints = outputs["waypoints"];
    this.pose = outputs["initial_pose"];
    this.robotYaw = yaw;
    this.robot = robot;
    this.show();
  }

  /** @param {Place} place */
  tap(place) {
    if (this.isBusy || this.aiming) return; // a gesture has set the place
    this.outcome = "";
    if (this.mode === "way") {
      if (this.places.length < MOST) this.places.push(place);
    } else if (this.goto && this.mode !== "sure") {
      this.mode = "place";
      this.target = "goto";
      this.places = [place];
      this.yaw = this.usualYaw();
    }
    this.show();
    this.changed();
  }

  /**
   * Take the place and the direction of a gesture.
   *
   * @param {Place} place
   * @param {number | null} yaw null while the gesture has no direction
   */
  aim(place, yaw) {
    if (this.isBusy || !this.aiming) return;
    this.outcome = "";
    this.mode = "place";
    this.target = this.aiming;
    this.places = [place];
    this.yaw = yaw ?? this.usualYaw();
    this.show();
    this.changed();
  }

  /** Start or end gestures for an output. @param {"goto" | "initial_pose"} output */
  toggleAim(output) {
    const isOn = this.aiming === output;
    this.clear();
    this.aiming = isOn ? "" : output;
    this.show();
    this.changed();
  }

  /** Turn the chosen direction. @param {number} angle in radians, counter-clockwise */
  turn(angle) {
    if (this.isBusy || this.yaw === null) return;
    this.yaw = wrapped(this.yaw + angle);
    this.show();
    this.changed();
  }

  /** Return the direction of a place without a gesture: the direction of travel, or that of the robot. */
  usualYaw() {
    const [place] = this.places;
    if (!place || !this.turns.has(this.target)) return null;
    const way = this.robot && this.target === "goto" ? Math.atan2(place[0] - this.robot[0], place[1] - this.robot[1]) : null;
    return way ?? this.robotYaw ?? 0;
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
    this.aiming = "";
    this.yaw = null;
    this.places = [];
    this.outcome = "";
    this.show();
    this.changed();
  }

  /** Return the reason why the choice cannot be sent, or "". */
  hindrance() {
    const outlet = this.mode !== "place" ? this.waypoints : this.target === "goto" ? this.goto : this.pose;
    if (this.places.some((place) => !isInside(place, this.fence))) return this.t("outside the fence");
    return outlet?.reason ?? "";
  }

  show() {
    const { mode, places, t } = this;
    const isWay = mode === "way" || mode === "sure";
    const isIdle = mode === "look" && !this.aiming;
    const hasTurn = mode === "place" && this.yaw !== null;
    attribute(this.bar, "hidden", isIdle && !this.outcome ? "" : null);
    attribute(this.no, "hidden", isIdle ? "" : null);
    for (const one of [this.left, this.right]) {
      attribute(one, "hidden", hasTurn ? null : "");
      attribute(one, "disabled", this.isBusy ? "" : null);
    }
    attribute(this.undo, "hidden", isWay ? null : "");
    attribute(this.undo, "disabled", places.length === 0 || this.isBusy ? "" : null);
    attribute(this.yes, "hidden", mode === "look" ? "" : null);
    attribute(this.no, "disabled", this.isBusy ? "" : null);
    const reason = mode === "look" ? "" : this.hindrance();
    const isShort = mode === "way" ? places.length < 2 : places.length < 1;
    attribute(this.yes, "disabled", reason !== "" || isShort || this.isBusy ? "" : null);
    write(this.yes, mode === "way" ? t("Send …") : mode === "sure" ? t("Send") : this.target === "initial_pose" ? t("It is here") : t("Go there"));
    attribute(this.bar, "data-mode", mode);
    const text = reason && places.length > 0 ? `▲ ${reason}` : this.question();
    write(this.words, this.outcome || text);
  }

  question() {
    const { mode, places, t, isLocal, robot, yaw } = this;
    const [place] = places;
    if (mode === "place" && place) {
      const angle = yaw === null ? "" : `, ∠ ${Math.round((yaw * 180) / Math.PI)}°`;
      const names = { place: placeText(place, this.form, isLocal) + angle };
      if (this.target === "initial_pose") return t("Is the robot at {place}?", names);
      const question = t("Go to {place}?", names);
      if (!robot) return question;
      const way = distanceText(distance(robot, place, isLocal));
      return [question, t("{distance} away", { distance: way })].join(" · ");
    }
    const names = { count: places.length, length: distanceText(lengthOf(places, isLocal)) };
    if (mode === "sure") return t("Send the robot to {count} places in order ({length})?", names);
    if (mode === "look" && this.aiming) return t("Press on the place, and drag in the direction.");
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
    const number = (this.sent += 1);
    this.isBusy = true;
    this.outcome = `… ${this.t("sending")}`;
    this.show();
    const timer = setTimeout(() => this.leave(number), SOON_MS);
    try {
      await this.send(isPlace ? this.target : "waypoints", isPlace ? this.one() : this.all());
      this.ended(number, "");
    } catch (error) {
      this.ended(number, `▲ ${error instanceof Error ? error.message : error}`);
    } finally {
      clearTimeout(timer);
    }
  }

  /** Let the operator choose again while the robot is on its way. @param {number} number */
  leave(number) {
    if (number !== this.sent || !this.isBusy) return;
    this.isBusy = false;
    this.clear();
    this.outcome = `… ${this.t("on the way")}`;
    this.show();
  }

  /**
   * Show how a command ended, unless a newer one has been sent or the operator chooses again.
   *
   * @param {number} number
   * @param {string} fault "" if the robot has done it
   */
  ended(number, fault) {
    if (number !== this.sent) return;
    const isQuick = this.isBusy;
    this.isBusy = false;
    if (isQuick && !fault) this.clear();
    if (isQuick || (this.mode === "look" && !this.aiming)) {
      this.outcome = fault || (isQuick ? `✓ ${this.t("sent")}` : this.t("✓ done"));
    }
    this.show();
  }

  one() {
    const [first, second] = rounded(this.places[0] ?? [0, 0], this.isLocal);
    const turn = this.yaw === null ? {} : { yaw: Math.round(this.yaw * 1e4) / 1e4 };
    return this.isLocal ? { x: second, y: first, ...turn } : { latitude: first, longitude: second, ...turn };
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
