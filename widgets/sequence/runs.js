// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */

/**
 * The common part of both kinds of runs. The server runs a sequence of the driver, which continues after
 * the page is closed. The page runs a list of commands, which ends when the page is closed.
 *
 * @typedef {"idle" | "running" | "paused"} State
 */

const STEPS = ["step_1", "step_2", "step_3", "step_4", "step_5", "step_6", "step_7", "step_8"];

class Run {
  /**
   * @param {Context} ctx
   * @param {boolean} isEach whether each step waits for the operator
   * @param {() => void} show
   */
  constructor(ctx, isEach, show) {
    this.ctx = ctx;
    this.isEach = isEach;
    this.show = show;
    /** @type {string[]} */
    this.names = [];
    /** Number of started steps. */
    this.place = 0;
    /** @type {State} */
    this.state = "idle";
    this.isDone = false;
    this.isFailed = false;
    this.outcome = "";
    this.reason = ctx.t("not ready yet");
  }

  get of() {
    return this.names.length;
  }

  end() {}
}

/** A sequence of the driver. The server reports its state, no matter which page started it. */
export class RobotSequence extends Run {
  /**
   * @param {Context} ctx
   * @param {boolean} isEach
   * @param {() => void} show
   */
  constructor(ctx, isEach, show) {
    super(ctx, isEach, show);
    const described = ctx.command("run");
    const steps = described?.steps ?? [];
    this.names = steps.map(({ text, what }) => ctx.t(text, { what }));
    const name = described?.command ?? "";
    // A plain command is its own only step.
    if (this.names.length === 0) this.names = [described?.title || name];
    this.isSequence = steps.length > 0;
    ctx.follow("sequences", (known) => {
      const one = known[name];
      if (!one) return;
      this.place = one.place;
      this.state = one.state;
      this.isFailed = one.state === "idle" && one.reason !== "";
      this.isDone = one.state === "idle" && !this.isFailed && one.place > 0;
      if (one.state !== "idle") this.outcome = "";
      else if (this.isFailed) this.outcome = `▲ ${one.reason}`;
      this.show();
    });
  }

  /** @param {Readonly<Record<string, Outlet>>} outputs */
  take(outputs) {
    this.reason = outputs["run"]?.reason ?? this.ctx.t("no command is bound here");
  }

  async start() {
    const { ctx } = this;
    this.outcome = "";
    if (this.isSequence) ctx.steer("run", this.isEach ? "step" : "resume");
    else [this.state, this.place, this.isDone, this.isFailed] = ["running", 1, false, false];
    this.show();
    try {
      await ctx.send("run");
      this.outcome = ctx.t("✓ done");
      this.isDone = true;
    } catch (error) {
      const isOurs = error instanceof Error && error.name === "Cancelled";
      this.outcome = `${isOurs ? "○" : "▲"} ${error instanceof Error ? error.message : error}`;
      // A sequence that failed to start must not start in the paused state later.
      if (this.isSequence && this.state === "idle") ctx.steer("run", "resume");
      if (!this.isSequence) this.isFailed = !isOurs;
    }
    if (!this.isSequence) this.state = "idle";
    this.show();
  }

  step() {
    this.ctx.steer("run", "step");
  }

  pause() {
    this.ctx.steer("run", "pause");
  }

  resume() {
    this.ctx.steer("run", "resume");
  }

  abort() {
    this.ctx.steer("run", "abort");
  }
}

/** A list of commands, which the page sends one after another. */
export class OwnList extends Run {
  /**
   * @param {Context} ctx
   * @param {boolean} isEach
   * @param {() => void} show
   */
  constructor(ctx, isEach, show) {
    super(ctx, isEach, show);
    this.outputs = STEPS.filter((name) => ctx.command(name) !== null);
    this.names = this.outputs.map((name) => ctx.command(name)?.title || ctx.command(name)?.command || name);
    this.isHalted = false;
    /** Reason why the run cannot continue, or "". */
    this.ended = "";
    /** @type {(() => void) | null} */
    this.goOn = null;
    ctx.onStop(({ phase }) => {
      if (phase !== "" && this.state !== "idle") this.abort(ctx.t("STOP was pressed"));
    });
  }

  /** @param {Readonly<Record<string, Outlet>>} outputs */
  take(outputs) {
    const reasons = this.outputs.map((name) => outputs[name]?.reason ?? "");
    this.reason = this.outputs.length === 0 ? this.ctx.t("no command is bound here") : reasons.find(Boolean) ?? "";
  }

  async start() {
    const { ctx } = this;
    this.ended = "";
    this.isHalted = this.isEach;
    [this.place, this.isDone, this.isFailed, this.outcome] = [0, false, false, ""];
    try {
      for (const name of this.outputs) {
        await this.turn();
        if (this.ended) throw new Error(this.ended);
        this.place += 1;
        this.become("running");
        await ctx.send(name);
        if (ctx.signal.aborted) return;
      }
      this.isDone = true;
      this.outcome = ctx.t("✓ done");
    } catch (error) {
      this.isFailed = true;
      this.outcome = `▲ ${error instanceof Error ? error.message : error}`;
    }
    this.become("idle");
  }

  /** Wait until the next step may begin. */
  async turn() {
    if (!this.isHalted || this.ended) return;
    this.become("paused");
    await new Promise((resolve) => {
      this.goOn = () => resolve(undefined);
    });
    this.goOn = null;
  }

  /** @param {State} state */
  become(state) {
    this.state = state;
    this.show();
  }

  step() {
    this.goOn?.();
  }

  pause() {
    this.isHalted = true;
  }

  resume() {
    this.isHalted = false;
    this.goOn?.();
  }

  abort(why = this.ctx.t("ended on request")) {
    this.ended = why;
    this.goOn?.();
  }

  end() {
    this.abort();
  }
}
