// @ts-check
/**
 * The robot's feedback about a route: whether the robot is on its way, whoever sent the route. Pure.
 *
 * @typedef {object} Told
 * @property {number} value Number of the waypoint to which the robot is on its way, from 0.
 * @property {number} serial
 * @property {boolean} isLive Whether the value is not old.
 * @property {boolean} hasLimit Whether the driver declares when the value is old.
 * @property {number} time Time of the measurement in seconds, on the page's clock.
 */

/** Age up to which a value without a declared limit counts as feedback of a route, in seconds. */
export const FRESH_S = 5;

export class Feedback {
  constructor() {
    /** @type {Told | null} */
    this.told = null;
    /** Serial number of the last value of the route that ended last. */
    this.endSerial = -1;
  }

  get serial() {
    return this.told?.serial ?? 0;
  }

  /** @param {Told | null} told */
  take(told) {
    this.told = told;
  }

  /** Note the end of a route: the present value says nothing of another one. */
  end() {
    this.endSerial = this.serial;
  }

  /** Time for which the present value still counts, in seconds; 0 if it does not count. @param {number} nowS */
  leftS(nowS) {
    const { told } = this;
    if (!told || !told.isLive || told.serial <= this.endSerial) return 0;
    return told.hasLimit ? Infinity : Math.max(0, told.time + FRESH_S - nowS);
  }
}
