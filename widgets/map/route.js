// @ts-check
/**
 * The waypoints of a route, in order, each with a direction. Pure: no DOM, no Leaflet.
 *
 * A waypoint without its own direction has the direction of travel: from the waypoint before it, or
 * from the robot.
 *
 * @typedef {import("./geo.js").Place} Place
 */

/** Maximum number of waypoints; a longer route is not drawn by hand. */
export const MOST = 200;

export class Route {
  /**
   * @param {readonly Place[]} [places]
   * @param {readonly (number | null)[]} [yaws] own directions in radians, counter-clockwise; null for
   *   the direction of travel
   */
  constructor(places = [], yaws = []) {
    this.places = [...places];
    this.yaws = this.places.map((_, index) => yaws[index] ?? null);
    /** Place of the chosen waypoint in the order; -1 in an empty route. */
    this.chosen = this.places.length - 1;
  }

  get size() {
    return this.places.length;
  }

  /** Add a waypoint at the end, and choose it. @param {Place} place */
  add(place) {
    if (this.size >= MOST) return;
    this.places.push(place);
    this.yaws.push(null);
    this.chosen = this.size - 1;
  }

  /** Choose a waypoint. @param {number} index */
  choose(index) {
    if (index >= 0 && index < this.size) this.chosen = index;
  }

  /** Delete a waypoint. @param {number} index */
  remove(index) {
    if (index < 0 || index >= this.size) return;
    this.places.splice(index, 1);
    this.yaws.splice(index, 1);
    this.chosen = Math.min(index, this.size - 1);
  }

  /**
   * Move a waypoint in the order, and choose it.
   *
   * @param {number} index
   * @param {number} by negative to an earlier place
   * @returns {boolean} whether it moved
   */
  move(index, by) {
    const to = index + by;
    if (![index, to].every((at) => at >= 0 && at < this.size)) return false;
    for (const list of [this.places, this.yaws]) list.splice(to, 0, .../** @type {any[]} */ (list.splice(index, 1)));
    this.chosen = to;
    return true;
  }

  /**
   * Set the direction of the chosen waypoint.
   *
   * @param {number} yaw
   */
  aim(yaw) {
    if (this.chosen >= 0) this.yaws[this.chosen] = yaw;
  }

  /**
   * Return the direction at each waypoint.
   *
   * @param {Place | null} robot place from which the route begins; null if it is unknown
   * @param {number} [usual] direction of the robot
   * @returns {number[]}
   */
  directions(robot, usual = 0) {
    let before = robot;
    let last = usual;
    return this.places.map((place, index) => {
      const isMoved = before !== null && (place[0] !== before[0] || place[1] !== before[1]);
      last = this.yaws[index] ?? (isMoved && before ? Math.atan2(place[0] - before[0], place[1] - before[1]) : last);
      before = place;
      return last;
    });
  }

  /**
   * Return the part of the route from a waypoint to the end, with their own directions.
   *
   * @param {number} from
   */
  rest(from) {
    return new Route(this.places.slice(from), this.yaws.slice(from));
  }
}
