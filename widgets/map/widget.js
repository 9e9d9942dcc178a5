// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./geo.js").Place} Place */
/** @typedef {typeof import("leaflet")} Leaflet */
import { DASH, attribute, button, colours, isStill, many, noteOf, number, part, style, svg, write } from "urc/kit";
import { Aim } from "./aim.js";
import { Choice } from "./choose.js";
import { Trail, arrowOf, bearingOf, headingText, isInside, placeOf, placeText, placesOf, readFix } from "./geo.js";
import { Grid } from "./grid.js";
import { cornersOf, sizeText } from "./grid_image.js";
import { Occupancy } from "./occupancy.js";
import { shareGoals } from "./shared_goals.js";
import { Shapes, metresOf } from "./shapes.js";

/** Inputs of which one is enough for the robot's own map. */
const LOCAL = ["x", "paths", "areas", "points", "poses", "goal_x"];

export default {
  /**
   * @param {Context} ctx
   * @returns {Promise<Instance>}
   */
  async mount(ctx) {
    const [leaflet] = await Promise.all([import("leaflet"), ctx.style("leaflet")]);
    if (ctx.signal.aborted) return {};
    const chart = new Chart(ctx, leaflet);
    ctx.follow("theme", () => chart.theme());
    ctx.follow("goals", (news) => chart.share(news));
    return {
      update: (readings, outputs) => chart.update(readings, outputs),
      resize: () => chart.resize(),
      destroy: () => chart.destroy(),
    };
  },
};

class Chart {
  /**
   * @param {Context} ctx
   * @param {Leaflet} leaflet
   */
  constructor(ctx, leaflet) {
    const { el, options, t, signal } = ctx;
    this.t = t;
    this.leaflet = leaflet;
    this.options = options;
    this.root = part(el, ".map");
    this.text = part(el, ".map-text");
    this.heading = part(el, ".map-heading");
    this.note = part(el, ".map-note");
    /** @type {"decimal" | "dms"} */
    this.form = options["format"] === "dms" ? "dms" : "decimal";
    /** Whether the map is the robot's own map; unknown before the first update. @type {boolean | null} */
    this.isLocal = null;
    this.signal = signal;
    this.ctx = ctx;
    this.isFollowing = true;
    this.hasPlace = false;
    /** Goals of all pages. @type {import("../../urc/web/static/core/types.js").Topics["goals"]} */
    this.goals = { isKnown: false, goals: [] };
    /** @type {Readonly<Record<string, any>> | undefined} */
    this.readings = undefined;
    /** @type {Place | null} */
    this.place = null;
    /** Serial numbers of the drawn points. */
    this.seenPoints = "";
    /** Reading of the position. @type {Reading | undefined} */
    this.reading = undefined;
    /** Description of the last drawing; "" after a move of the map. */
    this.drawn = "";
    this.trail = new Trail(Number(options["trail"] ?? 1000), Number(options["trail_step"] ?? 0.2), false);
    /** @type {Place[]} */
    this.fence = [];
    this.occupancy = new Occupancy(() => this.drawGrids());
    /** Zoom level at which the whole occupancy grid was shown last; -1 before. */
    this.fittedZoom = -1;
    this.map = this.makeMap(false);
  }

  destroy() {
    this.occupancy.end();
    this.map.remove();
  }

  /**
   * @param {boolean} isLocal
   */
  makeMap(isLocal) {
    const { leaflet, options } = this;
    const tiles = typeof options["tiles"] === "string" && !isLocal ? options["tiles"] : "";
    const map = new leaflet.Map(part(this.root, ".map-area"), {
      crs: isLocal ? leaflet.CRS.Simple : leaflet.CRS.EPSG3857,
      center: [0, 0],
      zoomSnap: isLocal ? 0.25 : 1,
      zoom: Number(options["zoom"] ?? (isLocal ? 5 : 18)),
      minZoom: isLocal ? -3 : 1,
      maxZoom: isLocal ? 10 : 22,
      // Leaflet's own controls create markup from text, which the page policy forbids.
      zoomControl: false,
      attributionControl: false,
      zoomAnimation: !isStill(),
      fadeAnimation: !isStill(),
      markerZoomAnimation: !isStill(),
      inertia: !isStill(),
    });
    if (tiles) new leaflet.TileLayer(tiles, { maxNativeZoom: Number(options["max_zoom"] ?? 19), maxZoom: 22 }).addTo(map);
    return map;
  }

  /**
   * Start the map for the bound inputs: the Earth, or the robot's own map.
   *
   * @param {Readonly<Record<string, Reading>>} readings
   * @param {Readonly<Record<string, Outlet>>} outputs
   */
  begin(readings, outputs) {
    const isEarth = readings["latitude"] !== undefined || readings["fix"] !== undefined;
    const hasGrids = many(readings["grids"]).length > 0;
    const isLocal = !isEarth && (hasGrids || LOCAL.some((name) => readings[name] !== undefined));
    this.isLocal = isLocal;
    if (isLocal) {
      this.map.remove();
      this.map = this.makeMap(true);
    }
    this.trail.isLocal = isLocal;
    this.fence = placesOf(this.options["fence"], isLocal);
    const { fence, form } = this;
    this.grid = new Grid(this.map, part(this.root, ".map-scale"), isLocal);
    if (this.fence[0]) this.grid.setOrigin(this.fence[0]);
    const turned = (/** @type {string} */ name) => this.ctx.command(name)?.arguments[name === "waypoints" ? "yaws" : "yaw"];
    const turns = new Set(Object.keys(outputs).filter((name) => isLocal && turned(name)));
    this.choice = new Choice(part(this.root, ".map-frame"), this.ctx, {
      isLocal,
      form,
      fence,
      changed: () => this.drawChoice(),
      turns,
    });
    if (isLocal) this.shapes = new Shapes(this.leaflet, this.map);
    this.aim = new Aim(this.map, this.signal, (place, yaw) => this.choice?.aim(place, yaw), () => this.choice?.unaim());
    this.grid.under = (pen) => {
      this.occupancy.paint(pen, this.map);
      this.shapes?.paint(pen);
    };
    attribute(this.root, "data-grids", hasGrids ? "" : null);
    this.addButtons("waypoints" in outputs, hasGrids);
    this.addAims(turns.has("goto"), isLocal && "initial_pose" in outputs);
    this.layers = this.makeLayers();
    this.theme();
    this.map.on("dragstart", () => this.follow(false));
    this.map.on("moveend", () => { this.drawn = ""; });
    this.map.on("zoomend", () => {
      this.shapes?.scale();
      this.drawChoice();
    });
    if ("goto" in outputs || "waypoints" in outputs || "initial_pose" in outputs) this.listen();
    shareGoals(this.choice, this.goals);
    if (fence.length > 2) this.map.fitBounds(new this.leaflet.LatLngBounds(fence), { animate: false });
  }

  /** Show the goals of all pages. @param {import("../../urc/web/static/core/types.js").Topics["goals"]} news */
  share(news) {
    this.goals = news;
    if (this.choice) shareGoals(this.choice, news);
  }

  listen() {
    this.map.on("click", ({ latlng: { lat, lng } }) => {
      if (!this.choice?.isAiming) this.choice?.tap([lat, lng]); // otherwise, the gesture has set the place
    });
    const key = (/** @type {KeyboardEvent} */ event) => {
      if (event.key === "Enter" && event.target === this.map.getContainer() && !event.repeat) {
        const { lat, lng } = this.map.getCenter();
        this.choice?.tap([lat, lng]);
      }
      if (event.key === "Escape" && this.choice && (this.choice.mode !== "look" || this.choice.aiming)) {
        event.preventDefault(); // here, Escape means no instead of STOP
        this.choice.clear();
      }
    };
    this.root.addEventListener("keydown", key, { signal: this.signal });
  }

  /**
   * @param {boolean} hasWay
   * @param {boolean} hasGrids
   */
  addButtons(hasWay, hasGrids) {
    const row = document.createElement("div");
    row.className = "map-tools";
    row.dataset["floats"] = "";
    const add = (/** @type {string} */ sign, /** @type {string} */ name, /** @type {() => void} */ press) => {
      const made = button("map-button", sign, press, { signal: this.signal, label: name });
      row.append(made);
      return made;
    };
    add("+", this.t("Zoom in"), () => this.map.zoomIn());
    add("−", this.t("Zoom out"), () => this.map.zoomOut());
    this.follower = add("", this.t("Follow the robot"), () => this.follow(!this.isFollowing));
    this.follower.append(icon(FOLLOW));
    if (hasGrids) add("⤢", this.t("Show the whole map"), () => this.fit());
    this.eraser = add("", this.t("Clear the trail"), () => this.clearTrail());
    this.eraser.append(icon(ERASE));
    this.eraser.classList.add("map-eraser");
    this.eraser.hidden = true;
    if (hasWay) this.wayButton = add("⤳", this.t("Draw a route"), () => this.toggleWay());
    part(this.root, ".map-frame").append(row);
    this.tools = row;
    this.follow(true);
  }

  /**
   * Add the buttons for gestures.
   *
   * @param {boolean} hasGoal
   * @param {boolean} hasPose
   */
  addAims(hasGoal, hasPose) {
    /** @type {Map<string, HTMLButtonElement>} */
    this.aims = new Map();
    const add = (/** @type {"goto" | "initial_pose"} */ output, /** @type {string} */ sign, /** @type {string} */ label) => {
      const made = button("map-button", sign, () => this.choice?.toggleAim(output), { signal: this.signal, label });
      this.tools?.append(made);
      this.aims?.set(output, made);
    };
    attribute(part(this.root, ".map-tools"), "data-many", hasGoal && hasPose ? "" : null);
    if (hasGoal) add("goto", "⚑", this.t("Goal with a direction"));
    if (hasPose) add("initial_pose", "⊕", this.t("Set the robot's position"));
  }

  /** Show the whole occupancy grid. */
  fit() {
    const { place } = this.occupancy;
    if (!place) return;
    this.follow(false);
    this.scale();
  }

  /** Scale the map to its occupancy grid; a followed robot stays in the middle. */
  scale() {
    const { place } = this.occupancy;
    if (!place) return;
    this.map.fitBounds(new this.leaflet.LatLngBounds(cornersOf(place)), { animate: false });
    this.fittedZoom = this.map.getZoom();
    if (this.isFollowing && this.place) this.map.panTo(this.place, { animate: false });
  }

  /** Adapt to another size of the cell; a map that was shown whole stays whole. */
  resize() {
    this.map.invalidateSize({ animate: false });
    if (this.map.getZoom() === this.fittedZoom) this.scale();
  }

  /** Draw new grids; the first one determines the scale, unless an option does. */
  drawGrids() {
    const { place } = this.occupancy;
    const isFree = (this.options["zoom"] ?? null) === null && this.fence.length === 0;
    if (place && isFree && this.fittedZoom === -1) this.scale();
    this.grid?.ask();
    this.describe();
  }

  drawTrail() {
    const { places } = this.trail;
    this.layers?.trail.setLatLngs(places);
    if (this.eraser && this.eraser.hidden !== places.length < 2) this.eraser.hidden = places.length < 2;
  }

  clearTrail() {
    this.trail.clear();
    this.drawTrail();
  }

  toggleWay() {
    this.choice?.toggleWay();
    this.drawChoice();
  }

  /** @param {boolean} isOn */
  follow(isOn) {
    this.isFollowing = isOn;
    if (this.follower) attribute(this.follower, "aria-pressed", String(isOn));
    const place = this.trail.places.at(-1);
    if (isOn && place && this.hasPlace) this.map.panTo(place, { animate: !isStill() });
  }

  makeLayers() {
    const { leaflet, map } = this;
    const arrow = svg("svg", { class: "map-arrow", viewBox: "-20 -20 40 40", "aria-hidden": "true" });
    arrow.append(svg("path", { class: "map-body", d: "M0 -16 11 12 0 6 -11 12Z" }), svg("circle", { class: "map-dot", r: 8 }));
    const holder = document.createElement("div");
    holder.className = "map-robot";
    holder.append(arrow);
    const icon = new leaflet.DivIcon({ html: holder, className: "map-pin", iconSize: [40, 40] });
    const fence = this.fence.length > 2 ? new leaflet.Polygon(this.fence, { fill: false, interactive: false }).addTo(map) : null;
    const line = (/** @type {object} */ given) => new leaflet.Polyline([], { interactive: false, ...given }).addTo(map);
    return {
      fence,
      holder,
      arrow,
      trail: line({ weight: 4 }),
      way: line({ weight: 3, dashArray: "8 6" }),
      turn: line({ weight: 4 }),
      ring: new leaflet.Circle([0, 0], { radius: 0, weight: 1, interactive: false }),
      robot: new leaflet.Marker([0, 0], { icon, interactive: false, keyboard: false }),
      /** @type {(import("leaflet").CircleMarker | import("leaflet").Marker)[]} */
      marks: [],
    };
  }

  theme() {
    const ink = colours(this.root, ["text", "level", "line", "caution", "accent"]);
    this.shapes?.theme(colours(this.root, ["text", "series-1", "series-2", "series-4", "series-5"]));
    this.ink = ink;
    this.grid?.theme();
    this.occupancy.theme(colours(this.root, ["raised", "faint", "text", "series-3"]));
    this.layers?.trail.setStyle({ color: ink.level });
    this.layers?.ring.setStyle({ color: ink.level, fillColor: ink.level, fillOpacity: 0.15 });
    this.layers?.fence?.setStyle({ color: ink.caution, weight: 2, dashArray: "10 6" });
    this.drawChoice();
  }

  /**
   * @param {Readonly<Record<string, Reading>>} readings
   * @param {Readonly<Record<string, Outlet>>} outputs
   */
  update(readings, outputs) {
    if (this.isLocal === null) this.begin(readings, outputs);
    const isLocal = this.isLocal ?? false;
    const fix = readFix(readings["fix"]?.value);
    const [first, second] = isLocal ? ["y", "x"] : ["latitude", "longitude"];
    const place = fix.place ?? placeOf(number(readings[first ?? ""]), number(readings[second ?? ""]), isLocal);
    const reading = readings["fix"] ?? worse(readings[first ?? ""], readings[second ?? ""]);
    const grids = many(readings["grids"]);
    attribute(this.root, "data-state", (reading ?? grids[0])?.state ?? "none");
    const yaw = number(readings["yaw"]);
    const heading = number(readings["heading"]) ?? (yaw === null ? null : bearingOf(yaw));
    this.draw(place, heading, number(readings["accuracy"]) ?? fix.accuracy, reading?.state === "live");
    this.readings = readings;
    this.occupancy.update(grids);
    this.place = place;
    this.reading = reading;
    this.describe();
    this.shapes?.update(readings, place);
    const drawn = [...many(readings["points"]), ...many(readings["poses"])];
    const points = drawn.map(({ serial, state }) => `${serial}${state}`).join();
    if (points !== this.seenPoints) this.grid?.ask();
    this.seenPoints = points;
    this.choice?.update(outputs, place, yaw, feedbackOf(readings["waypoint"]));
  }

  /** Write the place of the robot, and what is wrong with it or with the grids. */
  describe() {
    const { place = null, reading } = this;
    const grids = many(this.readings?.["grids"]);
    const size = this.occupancy.place;
    const isAlone = reading === undefined && grids.length > 0;
    const isLocal = this.isLocal ?? false;
    write(this.text, place ? placeText(place, this.form, isLocal) : isAlone && size ? sizeText(size) : DASH);
    const isOut = place !== null && !isInside(place, this.fence);
    attribute(this.root, "data-fence", isOut ? "out" : null);
    const unknown = reading?.state === "live" && !place ? this.t("no position") : "";
    const note = reading ? noteOf(reading, this.t) : isAlone ? "" : this.t("no position is bound to this map");
    const told = grids.map((grid, index) => this.noteOfGrid(grid, index));
    write(this.note, [isOut ? `▲ ${this.t("outside the fence")}` : "", unknown, note, ...told].filter(Boolean).join(" · "));
  }

  /**
   * Return what is wrong with a grid, after its title; "" if it is live.
   *
   * @param {Reading} grid
   * @param {number} index
   */
  noteOfGrid(grid, index) {
    const isBad = this.occupancy.isBad(index);
    if (index > 0 && grid.state === "none") return ""; // many robots have a costmap only while driving
    const note = isBad ? `▲ ${this.t("this picture cannot be shown")}` : noteOf(grid, this.t);
    return note && `${grid.signal.title || grid.signal.name}: ${note}`;
  }

  /**
   * @param {Place | null} place
   * @param {number | null} heading
   * @param {number | null} accuracy
   * @param {boolean} isLive
   */
  draw(place, heading, accuracy, isLive) {
    const { layers, map } = this;
    if (!layers) return;
    if (!place) {
      layers.robot.remove();
      layers.ring.remove();
      write(this.heading, "");
      this.hasPlace = false;
      return;
    }
    style(layers.arrow, "transform", `rotate(${(heading ?? 0).toFixed(1)}deg)`);
    const isTold = heading !== null && isLive && !this.isLocal;
    const said = isTold && this.t("heading {angle}", { angle: headingText(heading) });
    write(this.heading, said ? ` · ${said}` : "");
    attribute(layers.holder, "data-heading", heading === null ? "unknown" : "known");
    const look = `${place} ${accuracy} ${isLive}`;
    if (look === this.drawn && this.hasPlace) return; // true for most readings of a robot at rest
    if (isLive && this.trail.add(place, performance.now())) this.drawTrail();
    if (!this.hasPlace) layers.robot.addTo(map);
    layers.robot.setLatLng(place);
    layers.ring.setLatLng(place).setRadius(accuracy ?? 0);
    if (accuracy !== null && accuracy > 0) layers.ring.addTo(map);
    else layers.ring.remove();
    const isFirst = !this.hasPlace && this.trail.places.length <= 1;
    this.hasPlace = true;
    if (isFirst && this.fence.length === 0) this.grid?.setOrigin(this.isLocal ? [0, 0] : place);
    if (this.isFollowing) map.panTo(place, { animate: false });
    this.drawn = look; // after the end of the move, which clears it
  }

  /**
   * Return the mark of a chosen place; the waypoints of a route have numbers.
   *
   * @param {Place} place
   * @param {number} index
   * @returns {import("leaflet").CircleMarker | import("leaflet").Marker}
   */
  markOf(place, index) {
    const { choice, leaflet, ink } = this;
    const isIn = isInside(place, this.fence);
    const isRoute = choice !== undefined && choice.mode !== "place" && !choice.isTrip && choice.places.length <= NUMBERED;
    if (!isRoute) {
      const color = (isIn ? ink?.text : ink?.caution) ?? "";
      return new leaflet.CircleMarker(place, { radius: 9, weight: 3, color, fillOpacity: 0, interactive: false });
    }
    const mark = document.createElement("div");
    mark.className = "map-mark";
    mark.textContent = String(index + 1 + (choice.mode === "look" ? choice.active?.at ?? 0 : 0));
    attribute(mark, "data-fence", isIn ? null : "out");
    attribute(mark, "data-chosen", choice.mode === "way" && index === choice.route.chosen ? "" : null);
    const icon = new leaflet.DivIcon({ html: mark, className: "map-pin", iconSize: [28, 28] });
    return new leaflet.Marker(place, { icon, interactive: false, keyboard: false });
  }

  drawChoice() {
    const { layers, choice, leaflet, ink } = this;
    if (!layers || !choice || !ink) return;
    for (const mark of layers.marks) mark.remove();
    layers.marks = choice.places.map((place, index) => this.markOf(place, index).addTo(this.map));
    const from = this.trail.places.at(-1);
    const way = from && this.hasPlace ? [from, ...choice.places] : [...choice.places];
    layers.way.setLatLngs(choice.places.length > 0 ? way : []).setStyle({ color: ink.text });
    const arrows = choice.angles.map((yaw, index) => arrowOf(choice.places[index] ?? [0, 0], yaw, metresOf(this.map, 48)));
    layers.turn.setLatLngs(arrows).setStyle({ color: ink.text });
    this.aim?.set(choice.isAiming);
    for (const [output, made] of this.aims ?? []) attribute(made, "aria-pressed", String(choice.aiming === output));
    attribute(this.root, "data-aim", choice.isAiming ? choice.aiming || "waypoints" : null);
    attribute(this.root, "data-mode", choice.mode);
    if (this.wayButton) {
      const isWay = choice.mode === "way" || choice.mode === "sure";
      attribute(this.wayButton, "aria-pressed", String(isWay));
    }
  }
}

/** Drawings of buttons whose characters are too small in most fonts. */
const FOLLOW = "M12 5a7 7 0 1 0 .01 0M12 2v5M12 17v5M2 12h5M17 12h5";
const ERASE = "M4 7h16M9 7V4h6v3M6.5 7l1 13h9l1-13";

/** @param {string} path */
function icon(path) {
  const drawing = svg("svg", { class: "map-icon", viewBox: "0 0 24 24", "aria-hidden": "true" });
  drawing.append(svg("path", { d: path }));
  return drawing;
}

/** Maximum number of waypoints with numbers on the map; more numbers would cover each other. */
const NUMBERED = 30;

/**
 * Return the robot's feedback about a route; null without a value.
 *
 * @param {Reading | undefined} reading
 * @returns {import("./feedback.js").Told | null}
 */
function feedbackOf(reading) {
  const value = number(reading);
  if (!reading || value === null) return null;
  const { serial, time, state, signal } = reading;
  return { value: Math.max(0, Math.round(value)), serial, time, isLive: state === "live", hasLimit: (signal.stale_after_s ?? 0) > 0 };
}

const RANK = ["live", "stale", "gone", "none"];

/**
 * Return the worse of two readings of one place.
 *
 * @param {Reading | undefined} one
 * @param {Reading | undefined} other
 */
function worse(one, other) {
  if (!one || !other) return one ?? other;
  return RANK.indexOf(other.state) > RANK.indexOf(one.state) ? other : one;
}
