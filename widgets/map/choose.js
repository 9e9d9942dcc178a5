// @ts-check
/**
 * Choice of a place or a route, with a confirmation. Independent of Leaflet: a listener draws the choice.
 *
 * A sent route is *active* until its command ends. If the operator ends it, STOP cancels it, or it
 * fails, the waypoints that are left are *kept*. The robot continues only after a new confirmation.
 *
 * If the outcome is unknown, for example after the loss of a connection, the route is *lost*: it stays
 * active, because the robot may go on. The server tells of the goals and routes of other pages, and of
 * those from before a reload. After a restart of the server, a route is known only from the robot's
 * feedback; the operator can end it.
 *
 * @typedef {import("../../urc/web/static/core/types.js").Context} Context
 * @typedef {import("./geo.js").Place} Place
 * @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet
 *
 * @typedef {object} ActiveRoute
 * @property {Route} route
 * @property {number} number Number of its command; 0 for a route of another page.
 * @property {number} goal Number of its goal at the server; 0 while unknown.
 * @property {string} by Name of the operator on another page; "" for a route of this page.
 * @property {number} at Waypoint to which the robot is on its way, from 0.
 * @property {number} serial Serial number of the feedback before the route.
 * @property {"" | "pause" | "clear"} end Why the operator ends it.
 * @property {boolean} isEnding Whether the request to end it is under way.
 * @property {boolean} isLost Whether its outcome is unknown.
 * @property {boolean} isHeld Whether the server holds it, although its outcome is unknown.
 * @property {ActiveRoute | null} before The route that it replaces, until the robot has accepted it.
 */
import { attribute, button, write } from "urc/kit";
import { Feedback } from "./feedback.js";
import { placeArguments, routeArguments } from "./goal_arguments.js";
import { distance, distanceText, isInside, lengthOf, placeText, wrapped } from "./geo.js";
import { Route } from "./route.js";
import { RouteList } from "./route_list.js";
import { shareGoals } from "./shared_goals.js";

/** Time after which a command counts as one that takes long, such as a goal, in milliseconds. */
const SOON_MS = 1000;
/** Time after which a route that does not end can be ended again, in milliseconds. */
const END_MS = 3000;
/** Codes of failures after which the robot may still be on its way. */
const UNKNOWN = ["disconnected", "timed-out", "stopped"];
/** Turn of one press, in radians. */
const STEP = Math.PI / 12;

export class Choice {
  /**
   * @param {HTMLElement} root
   * @param {Pick<Context, "t" | "send" | "signal" | "onStop">} ctx
   * @param {{isLocal: boolean, form: "decimal" | "dms", fence: readonly Place[], changed: () => void, turns: ReadonlySet<string>}} given
   *   `turns` are the outputs that take a direction.
   */
  constructor(root, { t, send, signal, onStop }, { isLocal, form, fence, changed, turns }) {
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
    /** Chosen place, outside a route. @type {Place | null} */
    this.spot = null;
    /** Route that the operator edits. */
    this.route = new Route();
    /**
     * Sent route whose command has not ended.
     * @type {ActiveRoute | null}
     */
    this.active = null;
    /** Place that the robot is on its way to, outside a route. @type {import("./goal_arguments.js").Trip | null} */
    this.trip = null;
    /** Waypoints that are left of a route that has ended early. @type {Route | null} */
    this.kept = null;
    /** Goals of all pages. @type {import("../../urc/web/static/core/types.js").Topics["goals"]} */
    this.news = { isKnown: false, goals: [] };
    this.feedback = new Feedback();
    /** Timer for the end of feedback that the driver does not limit. @type {number | undefined} */
    this.timer = undefined;
    /** Whether the operator ends a route that this page did not send. */
    this.isEnding = false;
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
    /** @type {Outlet | undefined} */
    this.end = undefined;
    /** @type {Outlet | undefined} */
    this.endGoal = undefined;
    this.bar = document.createElement("div");
    this.bar.className = "map-bar";
    this.bar.setAttribute("role", "group");
    this.bar.setAttribute("data-taken", "");
    this.bar.setAttribute("aria-label", t("Choose a place"));
    this.words = document.createElement("p");
    this.words.className = "map-words";
    this.words.setAttribute("role", "status");
    this.list = new RouteList({ t, signal, route: () => this.route, changed: () => this.edited() });
    this.no = this.button(t("Cancel"), () => this.clear(), signal);
    this.drop = this.button(t("Clear"), () => void this.forget(), signal);
    this.pause = this.button(t("Pause"), () => void this.finish("pause"), signal);
    this.stopRoute = this.button(t("End route"), () => void this.endOther(), signal);
    this.undo = this.button(t("Undo"), () => this.back(), signal);
    this.left = this.button("↺", () => this.turn(STEP), signal, t("Turn left by 15°"));
    this.right = this.button("↻", () => this.turn(-STEP), signal, t("Turn right by 15°"));
    this.yes = this.button("", () => void this.go(), signal);
    this.yes.classList.add("map-yes");
    this.bar.append(this.words, this.list.element, this.no, this.drop, this.undo, this.left, this.right, this.stopRoute, this.pause, this.yes);
    root.append(this.bar);
    onStop(({ phase }) => {
      if (phase === "confirmed" && this.active?.isLost) this.leftOver(this.active); // STOP has ended it
    });
    signal.addEventListener("abort", () => clearTimeout(this.timer));
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
   * @param {import("./feedback.js").Told | null} progress
   */
  update(outputs, robot, yaw, progress) {
    this.goto = outputs["goto"];
    this.waypoints = outputs["waypoints"];
    this.pose = outputs["initial_pose"];
    this.end = outputs["end_route"];
    this.endGoal = outputs["end_goal"];
    this.feedback.take(progress);
    if (progress) this.advance(progress);
    this.robotYaw = yaw;
    this.robot = robot;
    this.show();
  }

  /** Note the progress of the active route. @param {import("./feedback.js").Told} progress */
  advance({ value, serial }) {
    const { active } = this;
    if (!active || serial <= active.serial) return; // told of an earlier route
    const at = Math.min(Math.max(0, Math.round(value)), active.route.size - 1);
    if (at === active.at) return;
    active.at = at;
    this.changed();
  }

  /** Places to draw, in order. @returns {readonly Place[]} */
  get places() {
    if (this.mode === "place") return this.spot ? [this.spot] : [];
    if (this.mode !== "look") return this.route.places;
    if (this.isTrip && this.trip) return [this.trip.place];
    if (this.active) return this.active.route.places.slice(this.active.at);
    return this.kept?.places ?? [];
  }

  /** Directions to draw, for each place; [] without directions. @returns {readonly number[]} */
  get angles() {
    if (this.mode === "place") return this.yaw === null ? [] : [this.yaw];
    if (this.isTrip) return this.trip?.yaw === null || !this.trip ? [] : [this.trip.yaw];
    if (!this.turns.has("waypoints")) return [];
    if (this.mode !== "look") return this.directions(this.route);
    if (this.active) return this.directions(this.active.route).slice(this.active.at);
    return this.kept ? this.directions(this.kept) : [];
  }

  /** Whether the place that the robot is on its way to is shown: before kept and lost routes. */
  get isTrip() {
    const { active, trip } = this;
    return this.mode === "look" && trip !== null && (!active || (active.isLost && !trip.isLost));
  }

  /** @param {Route} route */
  directions(route) {
    return route.directions(this.robot, this.robotYaw ?? 0);
  }

  /** Whether a press on the map begins a gesture instead of a move of the map. */
  get isAiming() {
    return this.aiming !== "" || (this.mode === "way" && this.turns.has("waypoints"));
  }

  /** @param {Place} place */
  tap(place) {
    if (this.isBusy || this.aiming) return; // a gesture has set the place
    this.outcome = "";
    if (this.mode === "way") {
      this.route.add(place);
    } else if (this.goto && this.mode !== "sure") {
      this.mode = "place";
      this.target = "goto";
      this.spot = place;
      this.yaw = this.usualYaw();
    }
    this.edited();
    this.list.reveal();
  }

  /**
   * Take the place and the direction of a gesture.
   *
   * @param {Place} place
   * @param {number | null} yaw null while the gesture has no direction
   */
  aim(place, yaw) {
    if (this.isBusy || !this.isAiming) return;
    if (this.mode === "way") {
      if (yaw === null) this.tap(place);
      else this.route.aim(yaw);
    } else if (this.aiming) {
      this.outcome = "";
      this.mode = "place";
      this.target = this.aiming;
      this.spot = place;
      this.yaw = yaw ?? this.usualYaw();
    }
    this.edited();
  }

  /** Take back the place of a gesture that a second finger has turned into a move of the map. */
  unaim() {
    if (this.isBusy) return;
    if (this.mode === "way") this.route.remove(this.route.size - 1);
    else if (this.mode === "place") this.mode = "look";
    this.edited();
  }

  /** Start or end gestures for an output. @param {"goto" | "initial_pose"} output */
  toggleAim(output) {
    const isOn = this.aiming === output;
    this.clear();
    this.aiming = isOn ? "" : output;
    this.edited();
  }

  /** Turn the chosen direction. @param {number} angle in radians, counter-clockwise */
  turn(angle) {
    if (this.isBusy) return;
    if (this.mode === "way") this.route.aim(wrapped((this.directions(this.route)[this.route.chosen] ?? 0) + angle));
    else if (this.yaw !== null) this.yaw = wrapped(this.yaw + angle);
    this.edited();
  }

  /** Return the direction of a place without a gesture: the direction of travel, or that of the robot. */
  usualYaw() {
    const { spot } = this;
    if (!spot || !this.turns.has(this.target)) return null;
    const way = this.robot && this.target === "goto" ? Math.atan2(spot[0] - this.robot[0], spot[1] - this.robot[1]) : null;
    return way ?? this.robotYaw ?? 0;
  }

  /** Start or end the drawing of a route; a route that has ended early is edited. */
  toggleWay() {
    const isWay = this.mode === "way" || this.mode === "sure";
    this.clear();
    if (!isWay) this.mode = "way";
    this.edited();
  }

  back() {
    if (this.mode === "sure") this.mode = "way";
    else this.route.remove(this.route.size - 1);
    this.edited();
  }

  /** Show a change of the choice. */
  edited() {
    this.show();
    this.changed();
  }

  clear() {
    this.mode = "look";
    this.aiming = "";
    this.yaw = null;
    this.spot = null;
    this.route = this.kept ?? new Route();
    this.outcome = "";
    this.edited();
  }

  /** Delete all waypoints; an active route is ended. */
  async forget() {
    if (this.isBusy) return;
    if (this.mode === "look" && this.active) {
      await this.finish("clear");
      return;
    }
    this.kept = null;
    const { mode } = this;
    this.clear();
    if (mode === "way") this.mode = "way";
    this.edited();
  }

  /**
   * End the active route.
   *
   * @param {"pause" | "clear"} end whether to keep the waypoints that are left
   */
  async finish(end) {
    const { active } = this;
    if (!active || active.isEnding) return;
    active.end = end;
    active.isEnding = true;
    this.show();
    const isSent = await this.sendEnd();
    if (this.active !== active) return;
    if (!isSent) {
      active.end = ""; // the robot goes on, so the buttons remain
      active.isEnding = false;
    } else if (active.isLost) {
      this.leftOver(active); // no command is left whose end could be awaited
    } else {
      setTimeout(() => this.endAgain(active), END_MS);
    }
    this.show();
  }

  /** Let the operator end a route again that has not ended. @param {ActiveRoute} active */
  endAgain(active) {
    if (this.active !== active || !active.isEnding) return;
    active.isEnding = false;
    this.outcome = `▲ ${this.t("The robot has not ended the route. Try again, or press STOP.")}`;
    this.show();
  }

  /** End a goal, or a route that this page has not sent or no longer knows. */
  async endOther() {
    if (this.isEnding) return;
    this.isEnding = true;
    this.show();
    if (await this.sendEnd(this.isTrip ? "end_goal" : "end_route")) {
      this.feedback.end(); // newer feedback shows the button again
      this.outcome = `✓ ${this.t("sent")}`;
    }
    this.isEnding = false;
    this.edited();
  }

  /** Send the end of a route or goal; return whether that succeeded. @param {"end_route" | "end_goal"} [output] */
  async sendEnd(output = "end_route") {
    this.outcome = "";
    try {
      await this.send(output, {});
    } catch (error) {
      this.outcome = `▲ ${error instanceof Error ? error.message : error}`;
      return false;
    }
    return true;
  }

  /** Take a lost route as ended. @param {ActiveRoute} active */
  leftOver(active) {
    this.active = null;
    this.feedback.end();
    if (active.end !== "clear") this.keep(active.route.rest(active.at));
    this.outcome = active.end === "pause" ? this.t("Paused") : "";
    this.edited();
  }

  /** Whether the robot's feedback tells of a route that this page has not sent. */
  isOther() {
    clearTimeout(this.timer);
    const leftS = this.active || !this.end ? 0 : this.feedback.leftS(performance.now() / 1000);
    if (leftS > 0 && leftS < Infinity) this.timer = window.setTimeout(() => this.show(), leftS * 1000 + 50);
    return leftS > 0;
  }

  /** Return the reason why the choice cannot be sent, or "". */
  hindrance() {
    const outlet = this.mode !== "place" ? this.waypoints : this.target === "goto" ? this.goto : this.pose;
    const places = this.mode === "look" ? [] : this.places;
    if (places.some((place) => !isInside(place, this.fence))) return this.t("outside the fence");
    return outlet?.reason ?? "";
  }

  show() {
    const { mode, places, t } = this;
    const isWay = mode === "way" || mode === "sure";
    const isIdle = mode === "look" && !this.aiming;
    const isTrip = isIdle && this.isTrip;
    const isOther = this.isOther() && !this.isTrip;
    const [active, kept] = [isIdle && !isTrip ? this.active : null, isIdle && !this.active && !isOther ? this.kept : null];
    const isTurned = (mode === "place" && this.yaw !== null) || (mode === "way" && places.length > 0 && this.turns.has("waypoints"));
    const hide = (/** @type {Element} */ part, /** @type {boolean} */ isShown) => attribute(part, "hidden", isShown ? null : "");
    const disable = (/** @type {Element} */ part, /** @type {boolean} */ isOff) => attribute(part, "disabled", isOff ? "" : null);
    attribute(this.bar, "data-moving", this.active || this.trip || isOther ? "" : null); // Escape is then STOP
    hide(this.bar, !isIdle || this.outcome !== "" || active !== null || kept !== null || isOther || isTrip);
    hide(this.no, !isIdle);
    disable(this.no, this.isBusy);
    for (const one of [this.left, this.right]) {
      hide(one, isTurned);
      disable(one, this.isBusy);
    }
    hide(this.undo, isWay);
    disable(this.undo, places.length === 0 || this.isBusy);
    const canEnd = active !== null && this.end !== undefined;
    const cannotEnd = (this.end?.reason ?? "") !== "";
    const isEnding = active !== null && (active.isEnding || cannotEnd);
    hide(this.stopRoute, (isIdle && isOther) || (isTrip && this.endGoal !== undefined));
    disable(this.stopRoute, this.isEnding || (isTrip ? (this.endGoal?.reason ?? "") !== "" : cannotEnd));
    write(this.stopRoute, isTrip ? t("Cancel goal") : t("End route"));
    hide(this.pause, canEnd);
    disable(this.pause, isEnding);
    hide(this.drop, canEnd || kept !== null || (mode === "way" && places.length > 0));
    disable(this.drop, isEnding || this.isBusy);
    this.showList(mode === "way");
    const reason = mode === "look" ? "" : this.hindrance();
    const isShort = mode === "way" ? places.length < (this.end ? 1 : 2) : places.length < 1;
    hide(this.yes, mode !== "look" || kept !== null);
    disable(this.yes, reason !== "" || isShort || this.isBusy);
    const send = { look: t("Continue …"), way: t("Send …"), sure: t("Send"), place: t("Go there") }[mode];
    write(this.yes, mode === "place" && this.target === "initial_pose" ? t("It is here") : send);
    attribute(this.bar, "data-mode", mode);
    const text = reason && places.length > 0 ? `▲ ${reason}` : this.question();
    const isToldToo = kept !== null || active?.isLost || active?.number === 0 || isTrip || (isIdle && isOther);
    write(this.words, this.outcome ? [this.outcome, isToldToo ? text : ""].filter(Boolean).join(" · ") : text);
  }

  /** @param {boolean} isShown */
  showList(isShown) {
    const angles = isShown ? this.angles : [];
    const texts = isShown ? this.route.places.map((place, index) => this.placeText(place, angles[index] ?? null)) : [];
    attribute(this.list.element, "hidden", texts.length > 0 ? null : "");
    this.list.show(texts, this.isBusy);
  }

  /**
   * @param {Place} place
   * @param {number | null} yaw
   */
  placeText(place, yaw) {
    return placeText(place, this.form, this.isLocal) + (yaw === null ? "" : `, ∠ ${Math.round((yaw * 180) / Math.PI)}°`);
  }

  question() {
    const { mode, places, t, isLocal, robot, yaw, active, kept } = this;
    const [place] = places;
    if (mode === "place" && place) {
      const names = { place: this.placeText(place, yaw) };
      if (this.target === "initial_pose") return t("Is the robot at {place}?", names);
      const question = t("Go to {place}?", names);
      if (!robot) return question;
      const way = distanceText(distance(robot, place, isLocal));
      return [question, t("{distance} away", { distance: way })].join(" · ");
    }
    const names = { count: places.length, length: distanceText(lengthOf(places, isLocal)) };
    if (mode === "sure") return t("Send the robot to {count} places in order ({length})?", names);
    if (mode === "look" && this.aiming) return t("Press on the place, and drag in the direction.");
    if (mode === "look" && active && !this.isTrip) {
      const way = { number: active.at + 1, count: active.route.size };
      const told = active.isLost ? t("The robot may still be on its way to waypoint {number} of {count}", way) : t("On the way to waypoint {number} of {count}", way);
      return [told, active.by].filter(Boolean).join(" · ");
    }
    if (this.isTrip && this.trip) {
      const { by, isLost, yaw: turn } = this.trip;
      const way = { place: this.placeText(this.trip.place, turn) };
      const told = isLost ? t("The robot may still be on its way to {place}", way) : t("On the way to {place}", way);
      const left = kept && !active ? t("Waypoints left: {count}", { count: kept.size }) : "";
      return [told, by, left].filter(Boolean).join(" · ");
    }
    const { told } = this.feedback;
    if (mode === "look" && told && this.isOther()) return t("On the way to waypoint {number}", { number: told.value + 1 });
    if (mode === "look" && kept) return t("Waypoints left: {count}", names);
    if (mode !== "way") return "";
    if (places.length > 0) return t("{count} places, {length}", names);
    return this.turns.has("waypoints") ? t("Tap the places in order; drag for a direction.") : t("Tap the places in order.");
  }

  async go() {
    if (this.yes.disabled) return;
    if (this.mode === "look" && this.kept) this.route = this.kept;
    if (this.mode === "look" || this.mode === "way") {
      this.mode = "sure"; // a route needs a second confirmation
      this.outcome = "";
      this.edited();
      return;
    }
    const isPlace = this.mode === "place";
    const number = (this.sent += 1);
    const given = isPlace
      ? placeArguments(this.places[0] ?? [0, 0], this.yaw, this.isLocal)
      : routeArguments(this.places, this.turns.has("waypoints") ? this.angles : null, this.isLocal);
    if (!isPlace) {
      const { serial } = this.feedback;
      const before = this.active;
      this.active = { route: this.route.rest(0), number, goal: 0, by: "", at: 0, serial, end: "", isEnding: false, isLost: false, isHeld: false, before };
    }
    this.isBusy = true;
    this.outcome = `… ${this.t("sending")}`;
    this.show();
    const timer = setTimeout(() => this.leave(number), SOON_MS);
    try {
      await this.send(isPlace ? this.target : "waypoints", given);
      this.ended(number, "");
    } catch (error) {
      const code = error instanceof Error ? String(Reflect.get(error, "code") ?? "") : "";
      this.ended(number, `▲ ${error instanceof Error ? error.message : error}`, UNKNOWN.includes(code));
    } finally {
      clearTimeout(timer);
    }
  }

  /** Let the operator choose again while the robot is on its way. @param {number} number */
  leave(number) {
    if (number !== this.sent || !this.isBusy) return;
    const isRoute = this.active?.number === number;
    this.isBusy = false;
    if (isRoute) this.kept = null;
    if (isRoute && this.active) this.active.before = null;
    this.clear();
    this.outcome = (isRoute && this.end) || this.trip ? "" : `… ${this.t("on the way")}`;
    this.show();
  }

  /**
   * Show how a command ended, unless a newer one has been sent or the operator chooses again.
   *
   * @param {number} number
   * @param {string} fault "" if the robot has done it
   * @param {boolean} [isUnknown] whether the robot may go on nevertheless
   */
  ended(number, fault, isUnknown = false) {
    if (this.active?.before?.number === number) this.active.before = null;
    if (isUnknown && this.end && this.active?.number === number) {
      this.lose(number, fault);
      return;
    }
    const isLast = number === this.sent;
    const isQuick = isLast && this.isBusy;
    const { active } = this;
    const end = active?.number === number ? active.end : "";
    if (active?.number === number) {
      this.active = fault && isQuick ? active.before : null;
      this.feedback.end();
      if (!fault && isQuick) this.kept = null;
      if (fault && !isQuick && this.end && end !== "clear") this.keep(active.route.rest(active.at));
    }
    if (isLast) this.isBusy = false;
    if (isQuick && !fault) this.clear();
    if (isLast && (isQuick || (this.mode === "look" && !this.aiming))) {
      const done = isQuick ? `✓ ${this.t("sent")}` : this.t("✓ done");
      this.outcome = end === "" || !fault ? fault || done : end === "pause" ? this.t("Paused") : "";
    }
    shareGoals(this, this.news); // another page may have replaced it
  }

  /**
   * Keep a route active whose outcome is unknown.
   *
   * @param {number} number
   * @param {string} fault
   */
  lose(number, fault) {
    this.leave(number);
    const { active } = this;
    if (!active) return;
    active.isLost = true;
    active.isEnding = false;
    if (this.mode === "look" && !this.aiming) this.outcome = fault;
    this.edited();
  }

  /** Keep the waypoints that are left of a route. @param {Route} rest */
  keep(rest) {
    this.kept = rest;
    if (this.mode === "look") this.route = rest;
  }
}
