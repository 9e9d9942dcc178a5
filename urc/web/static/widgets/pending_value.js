// @ts-check
/**
 * A requested value, until the robot confirms it or the time limit ends. Afterwards, a control
 * shows the robot's value.
 *
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").Value} Value
 */

export class PendingValue {
  /**
   * @param {object} spec
   * @param {number} spec.withinMs time limit of the confirmation
   * @param {() => void} spec.show called for changes over time
   * @param {AbortSignal} spec.signal
   * @param {(wished: Value, said: unknown) => boolean} [spec.isSame]
   */
  constructor({ withinMs, show, signal, isSame = (wished, said) => String(wished) === String(said) }) {
    this.withinMs = withinMs;
    this.show = show;
    this.isSame = isSame;
    /** Requested value; null without a request. @type {Value} */
    this.value = null;
    this.isMissed = false;
    /** Readings up to this number do not confirm the request. */
    this.serial = 0;
    /** The robot's current reading. @type {Reading | undefined} */
    this.said = undefined;
    /** @type {number | undefined} */
    this.timer = undefined;
    signal.addEventListener("abort", () => clearTimeout(this.timer));
  }

  get isWaiting() {
    return this.value !== null && !this.isMissed;
  }

  /**
   * @param {Value} value
   * @param {Reading | undefined} reading the robot's current reading
   */
  make(value, reading) {
    this.value = value;
    this.isMissed = false;
    this.serial = reading?.serial ?? 0;
    this.said = reading;
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.end(), this.withinMs);
  }

  /**
   * End the wait. A robot that reports only changes does not report a value that it already had.
   */
  end() {
    if (this.value !== null && this.isSaid(this.said)) this.drop();
    else this.isMissed = this.value !== null;
    this.show();
  }

  /** @param {Reading | undefined} reading */
  isSaid(reading) {
    return reading !== undefined && reading.value !== null && this.isSame(this.value, reading.value);
  }

  /** Drop an unsent request. */
  drop() {
    this.value = null;
    this.isMissed = false;
    clearTimeout(this.timer);
  }

  /** @param {Reading | undefined} reading */
  take(reading) {
    this.said = reading;
    if (this.value !== null && reading && reading.serial > this.serial && this.isSaid(reading)) this.drop();
  }
}
