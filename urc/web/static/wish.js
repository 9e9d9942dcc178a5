// @ts-check
/**
 * What was wished for, until the robot says the same; then, or when it does not, it is told so. What
 * a control shows is what the robot says.
 *
 * @typedef {import("./types.js").Reading} Reading
 * @typedef {import("./types.js").Value} Value
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
    clearTimeout(this.timer);
    this.timer = window.setTimeout(() => {
      this.isMissed = this.value !== null;
      this.show();
    }, this.withinMs);
  }

  /** It was not even given. */
  drop() {
    this.value = null;
    this.isMissed = false;
    clearTimeout(this.timer);
  }

  /** @param {Reading | undefined} reading */
  take(reading) {
    if (this.value === null || !reading || reading.value === null) return;
    if (reading.serial > this.serial && this.isSame(this.value, reading.value)) this.drop();
  }
}
