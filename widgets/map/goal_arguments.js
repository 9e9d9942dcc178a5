// @ts-check
/**
 * The arguments of goals and routes: places as lists of numbers, and back. Pure.
 *
 * A place is latitude and longitude, or y and x on the robot's own map.
 *
 * @typedef {import("./geo.js").Place} Place
 * @typedef {import("../../urc/web/static/core/types.js").Goal} Goal
 *
 * @typedef {object} Trip A goal with one place that the robot is on its way to.
 * @property {Place} place
 * @property {number | null} yaw
 * @property {string} by Name of the operator on another page who has sent it; "" for this page.
 * @property {boolean} isLost Whether its outcome is unknown.
 */
import { Route } from "./route.js";

/**
 * Return the arguments for one place.
 *
 * @param {Place} place
 * @param {number | null} yaw
 * @param {boolean} isLocal
 */
export function placeArguments(place, yaw, isLocal) {
  const [first, second] = rounded(place, isLocal);
  const turn = yaw === null ? {} : { yaw: Math.round(yaw * 1e4) / 1e4 };
  return isLocal ? { x: second, y: first, ...turn } : { latitude: first, longitude: second, ...turn };
}

/**
 * Return the arguments for a route.
 *
 * @param {readonly Place[]} places
 * @param {readonly number[] | null} yaws null for a command without directions
 * @param {boolean} isLocal
 * @returns {any} lists, for commands with array arguments
 */
export function routeArguments(places, yaws, isLocal) {
  const all = places.map((place) => rounded(place, isLocal));
  const [firsts, seconds] = [all.map(([first]) => first), all.map(([, second]) => second)];
  if (!isLocal) return { latitudes: firsts, longitudes: seconds };
  return { xs: seconds, ys: firsts, ...(yaws ? { yaws: yaws.map((yaw) => Math.round(yaw * 1e4) / 1e4) } : {}) };
}

/**
 * Return the route of a goal; null if its arguments are no route.
 *
 * @param {Goal} goal
 * @param {boolean} isLocal
 */
export function routeOf({ args }, isLocal) {
  const [firsts, seconds] = isLocal ? [args["ys"], args["xs"]] : [args["latitudes"], args["longitudes"]];
  if (!Array.isArray(firsts) || !Array.isArray(seconds) || firsts.length !== seconds.length || firsts.length === 0) return null;
  const yaws = Array.isArray(args["yaws"]) ? args["yaws"] : [];
  return new Route(firsts.map((first, index) => /** @type {Place} */ ([first, seconds[index]])), yaws);
}

/**
 * Return the place of a goal; null if its arguments are no place.
 *
 * @param {Goal | undefined} goal
 * @param {boolean} isLocal
 * @returns {Trip | null}
 */
export function tripOf(goal, isLocal) {
  if (!goal) return null;
  const { args, by, isOurs, isLost } = goal;
  const [first, second] = isLocal ? [args["y"], args["x"]] : [args["latitude"], args["longitude"]];
  if (typeof first !== "number" || typeof second !== "number") return null;
  const yaw = typeof args["yaw"] === "number" ? args["yaw"] : null;
  return { place: [first, second], yaw, by: isOurs ? "" : by, isLost };
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
