// @ts-check
/**
 * Paths, areas, points, poses, the goal, and the uncertainty of the position, on the robot's own map.
 *
 * Paths and areas are arrays of x and y in turn. The lines of several paths differ by dashes too.
 */
/** @typedef {typeof import("leaflet")} Leaflet */
/** @typedef {import("leaflet").Map} LeafletMap */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./geo.js").Place} Place */
import { many, number } from "urc/kit";
import { arrowOf, ellipseOf, isInMap, pairsOf, posesOf } from "./geo.js";

/** Dashes of the first, second, third and each further path. */
const DASHES = ["", "10 6", "2 6", "12 4 2 4"];
const SERIES = /** @type {const} */ (["series-1", "series-2", "series-4", "series-5"]);
/** Maximum number of drawn points; a cloud of particles looks the same with fewer. */
const MOST_POINTS = 5000;
const POINT = 3;
/** Length of a pose's line in pixels. */
const POSE = 9;

/**
 * @typedef {Record<"text" | "series-1" | "series-2" | "series-4" | "series-5", string>} Inks
 */

export class Shapes {
  /**
   * @param {Leaflet} leaflet
   * @param {LeafletMap} map
   */
  constructor(leaflet, map) {
    this.leaflet = leaflet;
    this.map = map;
    /** @type {import("leaflet").Polyline[]} */
    this.paths = [];
    /** @type {import("leaflet").Polygon[]} */
    this.areas = [];
    this.ellipse = new leaflet.Polygon([], { weight: 1, fillOpacity: 0.12, interactive: false }).addTo(map);
    this.goal = new leaflet.Polyline([], { weight: 4, interactive: false }).addTo(map);
    this.goalRing = new leaflet.CircleMarker([0, 0], { radius: 10, weight: 4, fill: false, interactive: false });
    /** @type {Place | null} */
    this.goalPlace = null;
    /** @type {number | null} */
    this.goalYaw = null;
    /** @type {readonly Reading[]} */
    this.points = [];
    /** @type {readonly Reading[]} */
    this.poses = [];
    /** Serial numbers at the last drawing. */
    this.seen = "";
    /** @type {Readonly<Record<string, any>>} */
    this.readings = {};
    /** @type {Place | null} */
    this.robot = null;
    /** @type {Inks | null} */
    this.inks = null;
  }

  /** @param {Inks} inks */
  theme(inks) {
    this.inks = inks;
    this.seen = "";
    this.ellipse.setStyle({ color: inks.text, fillColor: inks.text });
    for (const part of [this.goal, this.goalRing]) part.setStyle({ color: inks["series-2"] });
    this.update(this.readings, this.robot);
  }

  /**
   * @param {Readonly<Record<string, any>>} readings
   * @param {Place | null} robot
   */
  update(readings, robot) {
    [this.readings, this.robot] = [readings, robot];
    const [paths, areas] = [many(readings["paths"]), many(readings["areas"])];
    this.points = many(readings["points"]);
    this.poses = many(readings["poses"]);
    const names = ["goal_x", "goal_y", "goal_yaw", "covariance"];
    const all = [...paths, ...areas, ...names.map((name) => readings[name])];
    const seen = [...all.map((one) => (one ? `${one.serial}${one.state}` : "")), robot].join();
    if (seen === this.seen) return;
    this.seen = seen;
    const { leaflet, map } = this;
    paths.forEach((path, place) => {
      const line = (this.paths[place] ??= new leaflet.Polyline([], { weight: 4, interactive: false }).addTo(map));
      line.setLatLngs(pairsOf(path.value));
      line.setStyle({ ...this.inkOf(place), ...ageOf(path) });
    });
    areas.forEach((area, place) => {
      const shape = (this.areas[place] ??= new leaflet.Polygon([], { weight: 2, fillOpacity: 0.1, interactive: false }).addTo(map));
      shape.setLatLngs(pairsOf(area.value));
      shape.setStyle({ color: this.inks?.text ?? "", fillColor: this.inks?.text ?? "", ...ageOf(area) });
    });
    const covariance = readings["covariance"];
    this.ellipse.setLatLngs(robot && covariance ? ellipseOf(robot, covariance.value) : []);
    if (covariance) this.ellipse.setStyle({ ...ageOf(covariance), fillOpacity: 0.12 });
    this.readGoal(readings);
  }

  /** @param {number} place */
  inkOf(place) {
    const color = this.inks?.[SERIES[place % SERIES.length] ?? "series-1"] ?? "";
    return { color, dashArray: DASHES[Math.min(place, DASHES.length - 1)] ?? "" };
  }

  /** @param {Readonly<Record<string, any>>} readings */
  readGoal(readings) {
    const [x, y] = [number(readings["goal_x"]), number(readings["goal_y"])];
    this.goalPlace = x !== null && y !== null && isInMap([y, x]) ? [y, x] : null;
    this.goalYaw = number(readings["goal_yaw"]);
    if (this.goalPlace) {
      this.goalRing.setLatLng(this.goalPlace).addTo(this.map);
      for (const part of [this.goal, this.goalRing]) part.setStyle(ageOf(readings["goal_x"]));
    } else this.goalRing.remove();
    this.scale();
  }

  /** Draw the goal's arrow in its constant size on the screen. */
  scale() {
    const { goalPlace: place, goalYaw: yaw, map } = this;
    this.goal.setLatLngs(place && yaw !== null ? arrowOf(place, yaw, metresOf(map, 36)) : []);
  }

  /**
   * Draw the points on a context with CSS pixels.
   *
   * @param {CanvasRenderingContext2D} pen
   */
  paint(pen) {
    for (const points of this.points) {
      if (points.value === null) continue;
      pen.fillStyle = this.inks?.["series-5"] ?? "";
      pen.globalAlpha = points.state === "live" ? 0.8 : 0.35;
      pen.beginPath();
      for (const place of pairsOf(points.value).slice(0, MOST_POINTS)) {
        const { x, y } = this.map.latLngToContainerPoint(place);
        pen.rect(x - POINT / 2, y - POINT / 2, POINT, POINT);
      }
      pen.fill();
    }
    for (const poses of this.poses) if (poses.value !== null) this.paintPoses(pen, poses);
    pen.globalAlpha = 1;
  }

  /**
   * Draw a dot for each pose, and a line in its direction.
   *
   * @param {CanvasRenderingContext2D} pen
   * @param {Reading} poses
   */
  paintPoses(pen, poses) {
    pen.fillStyle = pen.strokeStyle = this.inks?.["series-5"] ?? "";
    pen.globalAlpha = poses.state === "live" ? 0.8 : 0.35;
    pen.lineWidth = 1;
    pen.beginPath();
    for (const { place, yaw } of posesOf(poses.value).slice(0, MOST_POINTS)) {
      const { x, y } = this.map.latLngToContainerPoint(place);
      pen.fillRect(x - POINT / 2, y - POINT / 2, POINT, POINT);
      pen.moveTo(x, y);
      pen.lineTo(x + POSE * Math.cos(yaw), y - POSE * Math.sin(yaw));
    }
    pen.stroke();
  }
}

/**
 * Return the length of some pixels in metres.
 *
 * @param {LeafletMap} map
 * @param {number} pixels
 */
export function metresOf(map, pixels) {
  const [zero, one] = [map.latLngToContainerPoint([0, 0]), map.latLngToContainerPoint([0, 1])];
  return pixels / Math.max(1e-9, one.x - zero.x);
}

/** Return the style of a reading's age. @param {Pick<Reading, "state">} reading */
function ageOf({ state }) {
  return { opacity: state === "live" ? 1 : 0.35 };
}
