// @ts-check
/**
 * What was wished for, until the robot says the same; then, or when it does not, it is told so. What
 * a control shows is what the robot says.
 *
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").Value} Value
 */

export class Wish {
  /**
   * @param {object} spec
   * @param {number} spec.withinMs how long the robot may take to say the same
   * @param {() => void} spec.show called when any of it has changed by time
   * @param {AbortSignal} spec.signal
   * @param {(wished: Value, said: unknown) => boolean} [spec.isSame]
   */
  constructor({ withinMs, show, signal, isSame = (wished, said) => String(wished) === String(said) }) {
    this.withinMs = withinMs;
    this.show = show;
    this.isSame = isSame;
    /** null: nothing is wished. @type {Value} */
    this.value = null;
    this.isMissed = false;
    /** Readings up to this one do not answer the wish. */
    this.serial = 0;
    /** What the robot says now. @type {Reading | undefined} */
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
   * @param {Reading | undefined} reading what the robot says now
   */
  make(value, reading) {
    this.value = value;
    this.isMissed = false;
    this.serial = reading?.serial ?? 0;
    this.said = reading;
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => this.end(), this.withinMs);
  }

  /** Its time is over. A robot that tells changes only is silent about what it had done before. */
  end() {
    if (this.value !== null && this.isSaid(this.said)) this.drop();
    else this.isMissed = this.value !== null;
    this.show();
  }

  /** @param {Reading | undefined} reading */
  isSaid(reading) {
    return reading !== undefined && reading.value !== null && this.isSame(this.value, reading.value);
  }

  /** It was not even given. */
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
