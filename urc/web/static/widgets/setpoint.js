// @ts-check
/**
 * A setpoint that the operator sets: its commands, its displayed value, and the robot's
 * confirmation. The module draws nothing; slider, knob and number field are its three views.
 *
 * @typedef {import("../core/types.js").Value} Value
 * @typedef {import("../core/types.js").Context} Context
 * @typedef {import("../core/types.js").Outlet} Outlet
 * @typedef {import("../core/types.js").Reading} Reading
 */
import { boundsOf, keyed, snapped } from "./number_bounds.js";
import { CommandState } from "./command_state.js";
import { format, noteOf, number } from "./kit.js";
import { PendingValue } from "./pending_value.js";

export class Setpoint {
  /**
   * @param {Context} ctx uses its options send, every_ms, step, min, max, unit, precision, echo, echo_s
   * @param {() => void} show called after each change
   */
  constructor(ctx, show) {
    const { options, signal, send, t, onStop, memory } = ctx;
    this.ctx = ctx;
    this.show = show;
    this.isLive = options["send"] !== "release";
    this.isOptimistic = options["echo"] === "optimistic";
    this.bounds = boundsOf(Object.values(ctx.command("change")?.arguments ?? {})[0], options);
    /** Value of the gesture; null without a gesture. @type {number | null} */
    this.hand = null;
    /** Cancels the gesture. Set by the view. */
    this.drop = () => this.cancel();
    const kept = memory.read();
    /** Last sent value, kept across reloads of the page. @type {number | null} */
    this.last = typeof kept === "number" ? kept : null;
    /** @type {Reading | undefined} */
    this.state = undefined;
    const everyMs = Number(options["every_ms"] ?? 100);
    const give = async (/** @type {Record<string, Value>} */ args) => {
      await this.sent(send("change", args));
      if (!this.state) memory.write(args["value"]);
    };
    this.giver = new CommandState({ give, show, t, signal, everyMs, onStop });
    this.wish = new PendingValue({
      withinMs: 1000 * Number(options["echo_s"] ?? 3),
      show,
      signal,
      isSame: (wished, said) => Math.abs(Number(wished) - Number(said)) <= this.bounds.step / 2,
    });
    onStop(({ phase }) => {
      if (phase !== "" && this.hand !== null) this.drop(); // the remaining gesture sets nothing
    });
  }

  /** Value reported by the robot, or null. */
  get said() {
    return number(this.state);
  }

  /** Displayed value: the gesture's, or else the robot's, or else the last sent value. */
  get shown() {
    if (this.hand !== null) return this.hand;
    if (this.isOptimistic && this.wish.isWaiting) return Number(this.wish.value);
    return this.state ? this.said : this.last;
  }

  /** Start value of a step. */
  get from() {
    const wished = this.wish.isWaiting ? Number(this.wish.value) : null;
    return this.hand ?? wished ?? this.said ?? this.last ?? Math.max(this.bounds.min, Math.min(0, this.bounds.max));
  }

  /** Return 0 to 1 between the bounds; null for null. */
  shareOf(/** @type {number | null} */ value) {
    const { min, max } = this.bounds;
    if (value === null || max <= min) return null;
    return Math.min(1, Math.max(0, (value - min) / (max - min)));
  }

  /** @param {number} share 0 to 1 */
  at(share) {
    const { min, max } = this.bounds;
    return snapped(min + share * (max - min), this.bounds);
  }

  /** @param {number | null} value */
  text(value) {
    const { digits, unit } = this.bounds;
    return `${format(value, digits)}${unit ? ` ${unit}` : ""}`;
  }

  /**
   * @param {Reading | undefined} state
   * @param {Outlet | undefined} change
   */
  take(state, change) {
    this.state = state;
    this.wish.take(state);
    this.giver.take(change);
    if (!this.giver.isReady && this.hand !== null) this.drop();
  }

  /** @param {number} value present value of the gesture */
  move(value) {
    if (!this.giver.isReady) return;
    const isNews = this.hand !== value;
    this.hand = value;
    if (isNews && this.isLive) this.put(value);
    this.show();
  }

  /** End the gesture. */
  release() {
    const value = this.hand;
    this.hand = null;
    if (value !== null && !this.isLive && this.giver.isReady) this.put(value);
    this.show();
  }

  /** Cancel the gesture. */
  cancel() {
    this.hand = null;
    this.show();
  }

  /** @param {number} value value to set at once, without a gesture */
  set(value) {
    if (!this.giver.isReady) return;
    this.put(value);
    this.show();
  }

  /**
   * @param {string} key
   * @returns {boolean} whether the key has a meaning here
   */
  key(key) {
    const value = keyed(key, this.from, this.bounds);
    if (value === null) return false;
    this.set(value);
    return true;
  }

  /** @param {number} value */
  put(value) {
    this.last = value;
    if (this.state) this.wish.make(value, this.state);
    this.giver.newest({ value });
  }

  /** @param {Promise<unknown>} giving */
  async sent(giving) {
    try {
      await giving;
    } catch (error) {
      if (this.giver.next === null) this.wish.drop();
      throw error;
    }
  }

  /** "", "waiting" or "missed". */
  get wishState() {
    return this.wish.isMissed ? "missed" : this.wish.isWaiting && this.hand === null ? "waiting" : "";
  }

  note() {
    const { wish, giver, ctx } = this;
    const wished = wish.value === null ? "" : this.text(Number(wish.value));
    const waiting = this.wishState === "waiting" && !this.isOptimistic ? ctx.t("requested {wish}", { wish: wished }) : "";
    const missed = wish.isMissed ? ctx.t("≠ requested {wish}; the robot reports another value", { wish: wished }) : "";
    const outcome = this.state && giver.phase === "done" ? "" : giver.outcome;
    const why = giver.reason || giver.notice;
    const hindrance = why ? `◆ ${why}` : "";
    const state = this.state ? noteOf(this.state, ctx.t) : "";
    return [giver.isPending ? "" : outcome, hindrance, missed || waiting, state].filter(Boolean).join(" · ");
  }
}
