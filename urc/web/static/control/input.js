// @ts-check
/**
 * What hands do: held controls, sampled on the page's main thread, and every way of letting go.
 *
 * A grip is one thing that a hand holds: by one pointer, by keys, or by a gamepad. While it is held
 * its widget is asked for the values when the hand moves and in every animation frame, and a tick of
 * them goes out at once when they change, and every 50 ms. There is no timer that could go on when
 * the page does not: a page that is hidden, frozen, blocked or gone draws no frames, so it sends
 * nothing, and the server stops the robot.
 *
 * Whatever else happens to the page while a control is held means neutral, and the end of that
 * gesture. After that, and after a stop or a refusal, nothing is sent before a new gesture.
 *
 * @typedef {import("./drive.js").Drive} Drive
 * @typedef {import("../widgets/output.js").Output} Output
 * @typedef {import("../core/types.js").GateSpec} GateSpec
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 */
import { Gate } from "./gate.js";
import { ANY, Control, Grip } from "./grip.js";
import { Pads } from "./pad.js";
import { said, t } from "../core/words.js";

const TICK_MS = 50;
/** So long the server may take to grant the controls. */
const ASK_MS = 1500;
/** Moves of one control that go out at once are so far apart; what comes between waits for a frame. */
const SOONEST_MS = 4;

export class Input {
  /** @param {Drive} drive */
  constructor(drive) {
    this.drive = drive;
    /** @type {Map<string, Control>} */
    this.controls = new Map();
    /** @type {Set<Grip>} */
    this.grips = new Set();
    /** @type {Set<Gate>} */
    this.gates = new Set();
    /** Cells of dead-man controls, also of those that do not stand yet, or have failed. @type {Set<HTMLElement>} */
    this.gated = new Set();
    this.pads = new Pads(() => this.run());
    this.isRunning = false;
    this.frameMs = 0;
    /** Calls of the loop that was stopped last do nothing. */
    this.round = 0;
    this.watch();
  }

  /** Everything that means neutral, whoever holds what. */
  watch() {
    const all = (/** @type {string} */ why) => () => this.letGo(why);
    addEventListener("blur", all(t("the window lost the focus")));
    addEventListener("pagehide", all(t("the page was left")));
    addEventListener("resize", all(t("the window changed its size")));
    addEventListener("orientationchange", all(t("the screen was turned")));
    screen.orientation?.addEventListener("change", all(t("the screen was turned")));
    addEventListener("gamepaddisconnected", all(t("the gamepad is gone")));
    document.addEventListener("freeze", all(t("the page was frozen")));
    document.addEventListener("fullscreenchange", all(t("full screen began or ended")));
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) this.letGo(t("the page was hidden"));
    });
    document.addEventListener("contextmenu", (event) => {
      const target = event.target;
      for (const { spec } of this.gripped()) {
        if (target instanceof Node && spec.el.contains(target)) event.preventDefault();
      }
      this.letGo(t("a menu was opened"));
    });
  }

  /**
   * @param {Output} output
   * @param {HoldSpec} spec
   * @param {AbortSignal} signal
   */
  hold(output, spec, signal) {
    const control = this.controls.get(output.command) ?? new Control(output.command);
    this.controls.set(output.command, control);
    const grip = new Grip(this, control, output, spec);
    this.grips.add(grip);
    grip.listen(signal);
    grip.show(true);
  }

  /**
   * @param {GateSpec} spec
   * @param {AbortSignal} signal
   */
  gate(spec, signal) {
    const gate = new Gate(this, spec);
    this.gates.add(gate);
    gate.listen(signal);
    signal.addEventListener("abort", () => {
      gate.forget();
      this.gates.delete(gate);
    });
  }

  /** All that can be gripped; dead-man controls first, since the others ask for them. */
  gripped() {
    return [...[...this.gates].map((gate) => gate.grip), ...this.grips];
  }

  /** Whether anything is held that moves the robot. */
  isDriving() {
    return [...this.grips].some((grip) => grip.hand);
  }

  /** @param {Grip} grip */
  isGuarded(grip) {
    if ([...this.gates].some((gate) => gate.isHeld)) return true;
    const others = [...grip.control.grips].filter((other) => other !== grip);
    return others.some(({ hand }) => hand && hand.kind !== "stay");
  }

  /** @param {Grip} grip */
  begin(grip) {
    const { control } = grip;
    control.grips.add(grip);
    if (grip.output.refusal) this.spend(control, grip.output.refusal);
    if (control.phase === "idle" || (control.phase === "spent" && control.grips.size === 1)) {
      if (!grip.output.refusal) this.ask(control);
    }
    grip.show();
    this.run();
  }

  /** @param {Control} control */
  ask(control) {
    const { drive } = this;
    control.phase = "asking";
    control.reason = "";
    control.askedMs = performance.now();
    control.sent = "";
    const epoch = drive.lease?.epoch ?? -1;
    const refusal = this.refusal();
    if (!refusal && drive.isMine && epoch > control.closedEpoch) return;
    if (refusal || !drive.say("take")) this.spend(control, refusal || t("no connection to URC"));
  }

  /** Why nothing can be driven now; "" when it can be asked for. */
  refusal() {
    const refusal = this.against();
    if (refusal) return refusal;
    const isGated = this.gates.size + this.gated.size > 0;
    const isOpen = [...this.gates].some((gate) => gate.isOpen);
    return isGated && !isOpen ? t("hold the dead-man control first") : "";
  }

  /** Why nothing may be moved by this page now. */
  against() {
    const { lease, isMine } = this.drive;
    if (!lease) return t("no connection to URC");
    if (lease.latched && lease.latched === lease.name) return t("stopped: reset it first");
    if (lease.latched) return t("stopped by {name}: reset it first", { name: said(lease.latched) });
    if (!lease.drives) return t("this page only watches");
    if (lease.holder && !isMine) return t("{name} has the controls", { name: said(lease.holder.name) });
    return "";
  }

  /**
   * Why a command that is given once cannot be given now: whoever only watches gives none, and what
   * moves something by itself goes neither against STOP nor against whoever drives.
   *
   * @param {boolean} moves
   */
  hindrance(moves = false) {
    if (moves) return this.against();
    return this.drive.lease?.drives === false ? t("this page only watches") : "";
  }

  /**
   * The hand of a grip has moved: that goes out at once, not with the next frame.
   *
   * @param {Grip} grip
   */
  moved(grip) {
    const { control } = grip;
    const nowMs = performance.now();
    if (control.phase !== "held" || nowMs - control.movedMs < SOONEST_MS) return;
    if (nowMs - this.frameMs > control.leaseMs) return; // held up: the next frame ends the gesture
    control.movedMs = nowMs;
    grip.take(nowMs);
    this.stepOne(control, nowMs);
  }

  /** @param {Grip} grip */
  end(grip) {
    const { control } = grip;
    control.grips.delete(grip);
    if (control.grips.size === 0) {
      this.release(control);
      if (control.phase !== "spent") control.phase = "idle";
    }
    for (const other of [...control.grips]) other.check(); // what has stayed goes with the last hand
    grip.show();
  }

  /** @param {Control} control */
  release(control) {
    if (!control.isReleaseOwed) return;
    control.isReleaseOwed = false;
    this.drive.tell({ t: "release", command: control.command });
  }

  /**
   * End the gesture: what is held stays so without any effect, until it is let go.
   *
   * @param {Control} control
   * @param {string} reason
   */
  spend(control, reason) {
    control.phase = "spent";
    control.reason = reason;
    for (const grip of this.grips) if (grip.control === control) grip.show();
  }

  /**
   * Let go of everything that is held.
   *
   * @param {string} reason
   */
  letGo(reason) {
    for (const grip of this.grips) {
      if (!grip.hand) continue;
      grip.control.phase = "spent";
      grip.control.reason = reason;
      grip.drop(ANY);
    }
    for (const gate of this.gates) {
      gate.close(reason);
      gate.grip.drop(ANY);
    }
  }

  /** STOP was pressed, or the line is gone: no gesture survives that. @param {string} reason */
  spendAll(reason) {
    for (const gate of this.gates) if (!gate.spec.isHeld) gate.close(reason);
    for (const control of this.controls.values()) {
      if (control.grips.size > 0 && control.phase !== "spent") this.spend(control, reason);
    }
  }

  /**
   * The server has stopped a control, or refused its ticks. What ended the gesture first is why: the
   * ticks that were under way are refused for that.
   *
   * @param {string} command
   * @param {string} reason
   */
  stopped(command, reason) {
    const control = this.controls.get(command);
    if (!control) return;
    control.closedEpoch = this.drive.lease?.epoch ?? control.closedEpoch;
    control.isReleaseOwed = true;
    if (control.phase !== "spent" || !control.reason) this.spend(control, reason);
    if (control.grips.size === 0) this.release(control);
  }

  /** The lease has changed: what was said about the last gesture is over. */
  leaseChanged() {
    for (const control of this.controls.values()) {
      if (control.phase !== "spent" || control.grips.size > 0 || this.drive.isLatched) continue;
      control.phase = "idle";
      for (const grip of this.grips) if (grip.control === control) grip.show();
    }
  }

  /** The server refused a wish. @param {string} reason */
  refused(reason) {
    for (const control of this.controls.values()) {
      if (control.phase === "asking") this.spend(control, reason);
    }
  }

  /** Sample from now on, for as long as something is held. */
  run() {
    if (this.isRunning) return;
    this.isRunning = true;
    this.frameMs = performance.now();
    this.round += 1;
    const { round } = this;
    const frame = () => {
      if (round !== this.round) return;
      this.isRunning = this.step(performance.now());
      if (this.isRunning) requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /**
   * One frame.
   *
   * @param {number} nowMs
   * @returns {boolean} whether there is to be another
   */
  step(nowMs) {
    const gapMs = nowMs - this.frameMs;
    this.frameMs = nowMs;
    this.pads.step(this.gripped(), nowMs);
    for (const gate of this.gates) gate.step(nowMs);
    for (const control of this.controls.values()) {
      for (const grip of [...control.grips]) grip.check();
      if (control.grips.size === 0) continue;
      if (gapMs > control.leaseMs && control.phase === "held") {
        this.spend(control, t("the page was held up"));
        this.release(control);
      }
      for (const grip of control.grips) grip.take(nowMs, control.phase !== "held");
      this.stepOne(control, nowMs);
      for (const grip of control.grips) grip.show();
    }
    const isOpen = [...this.gates].some((gate) => gate.isOpen);
    return this.pads.isConnected || isOpen || this.isDriving();
  }

  /**
   * @param {Control} control
   * @param {number} nowMs
   */
  stepOne(control, nowMs) {
    const { drive } = this;
    const lease = drive.lease;
    if (control.phase === "asking") {
      if (lease && drive.isMine && drive.beat && lease.epoch > control.closedEpoch) {
        control.phase = "held";
        control.epoch = lease.epoch;
      } else if (nowMs - control.askedMs > ASK_MS) {
        this.spend(control, t("URC did not answer"));
      }
    }
    if (control.phase !== "held") return;
    if (!lease || !drive.isMine || lease.epoch !== control.epoch) {
      this.spend(control, this.refusal() || t("the controls were taken anew"));
      return;
    }
    this.tick(control, nowMs);
  }

  /**
   * @param {Control} control
   * @param {number} nowMs
   */
  tick(control, nowMs) {
    const { drive } = this;
    const values = control.together.values(control.grips);
    const text = JSON.stringify(values);
    if (text === control.sent && nowMs - control.sentMs < TICK_MS) return;
    if (!drive.isFree) return; // the newest goes when the line is free, not after others
    const { command, epoch } = control;
    const tick = { t: "tick", command, arguments: values, epoch, echo: drive.beat };
    control.isReleaseOwed = drive.tell(tick, true);
    control.sent = text;
    control.sentMs = nowMs;
  }

  /** @param {Grip} grip */
  forget(grip) {
    grip.drop(ANY);
    this.grips.delete(grip);
  }
}
