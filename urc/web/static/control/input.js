// @ts-check
/**
 * Held controls of a page: sampling on the main thread, and all kinds of release.
 *
 * A held control samples its widget when its input moves and in every animation frame. A change of
 * the values sends a tick immediately; unchanged values are sent again every 50 ms. No timer sends
 * ticks: a hidden, frozen, blocked or closed page draws no frames and therefore sends nothing, and
 * the server stops the robot.
 *
 * Any other event of the page during a hold sends neutral values and ends the gesture. After that,
 * and after a stop or a refusal, nothing is sent until a new gesture begins.
 *
 * @typedef {import("./drive.js").Drive} Drive
 * @typedef {import("../widgets/output.js").Output} Output
 * @typedef {import("../core/types.js").GateSpec} GateSpec
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 */
import { DeadMan } from "./dead_man.js";
import { ShownImages } from "./shown_images.js";
import { ANY, Control, HeldControl } from "./held_control.js";
import { Gamepads } from "./gamepad.js";
import { said, t } from "../core/words.js";

/** Roles in order of increasing rights. */
const ROLES = ["watch", "drive", "maintain", "administer"];
const TICK_MS = 50;
/** Time limit for the grant of the controls. */
const ASK_MS = 1500;
/** Minimum interval between early ticks of one control; moves in between wait for the frame. */
const SOONEST_MS = 4;

export class Input {
  /** @param {Drive} drive */
  constructor(drive) {
    this.drive = drive;
    this.images = new ShownImages();
    /** @type {Map<string, Control>} */
    this.controls = new Map();
    /** @type {Set<HeldControl>} */
    this.grips = new Set();
    /** @type {Set<DeadMan>} */
    this.gates = new Set();
    /** Cells of dead-man controls, also of unmounted or failed ones. @type {Set<HTMLElement>} */
    this.gated = new Set();
    this.pads = new Gamepads(() => this.run());
    /** The control that was held last. @type {HeldControl | null} */
    this.last = null;
    this.isRunning = false;
    this.frameMs = 0;
    /** Number of the sampling loop; callbacks of an older loop do nothing. */
    this.round = 0;
    this.watch();
  }

  /** Listen for all page events that release held controls. */
  watch() {
    const all = (/** @type {string} */ why) => () => this.letGo(why);
    addEventListener("blur", all(t("the window lost focus")));
    addEventListener("pagehide", all(t("you left the page")));
    // A rotation resizes the window, too, and some browsers report that first.
    let { angle } = screen.orientation ?? {};
    addEventListener("resize", () => {
      const isRotated = angle !== screen.orientation?.angle;
      angle = screen.orientation?.angle;
      this.letGo(isRotated ? t("the screen was rotated") : t("the window was resized"));
    });
    addEventListener("orientationchange", all(t("the screen was rotated")));
    screen.orientation?.addEventListener("change", all(t("the screen was rotated")));
    addEventListener("gamepaddisconnected", all(t("the gamepad was disconnected")));
    document.addEventListener("freeze", all(t("the page was frozen")));
    document.addEventListener("fullscreenchange", all(t("full-screen mode changed")));
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
    const grip = new HeldControl(this, control, output, spec);
    this.grips.add(grip);
    grip.listen(signal);
    grip.show(true);
  }

  /**
   * @param {GateSpec} spec
   * @param {AbortSignal} signal
   */
  gate(spec, signal) {
    const gate = new DeadMan(this, spec);
    this.gates.add(gate);
    gate.listen(signal);
    signal.addEventListener("abort", () => {
      gate.forget();
      this.gates.delete(gate);
    });
  }

  /** All held controls; dead-man controls first, since the others depend on them. */
  gripped() {
    return [...[...this.gates].map((gate) => gate.grip), ...this.grips];
  }

  /** Whether a control that moves the robot is held. */
  isDriving() {
    return [...this.grips].some((grip) => grip.hand);
  }

  /** Whether an element belongs to a held control. @param {EventTarget | null} target */
  owns(target) {
    return [...this.grips].some((grip) => grip.contains(target));
  }

  /** Focus the last held control, or else the first one on the screen. */
  focus() {
    const found = [...(this.last ? [this.last] : []), ...this.grips].find(({ spec: { el } }) => {
      return el.tabIndex >= 0 && el.checkVisibility();
    });
    found?.spec.el.focus();
  }

  /** @param {HeldControl} grip */
  isGuarded(grip) {
    if ([...this.gates].some((gate) => gate.isHeld)) return true;
    const others = [...grip.control.grips].filter((other) => other !== grip);
    return others.some(({ hand }) => hand && hand.kind !== "stay");
  }

  /** @param {HeldControl} grip */
  begin(grip) {
    const { control } = grip;
    this.last = grip;
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

  /** Reason why driving is impossible now; "" if control can be requested. */
  refusal() {
    const refusal = this.against();
    if (refusal) return refusal;
    const isGated = this.gates.size + this.gated.size > 0;
    const isOpen = [...this.gates].some((gate) => gate.isOpen);
    return isGated && !isOpen ? t("hold the dead-man control first") : "";
  }

  /** Reason of a latched STOP, in words; "" while none is latched. The bar names the operator. */
  stopReason() {
    return this.drive.lease?.latched ? t("Reset STOP first.") : "";
  }

  /** Reason why this page may not move the robot now. */
  against() {
    const { lease, isMine } = this.drive;
    if (!lease) return t("no connection to URC");
    if (lease.latched) return this.stopReason();
    if (!lease.drives) return said(lease.limit ?? "") || t("this page only watches");
    if (lease.holder && !isMine) return t("{name} has the controls", { name: said(lease.holder.name) });
    return "";
  }

  /**
   * Reason why this page's role is too low for a command; "" if it is sufficient or not known yet.
   *
   * @param {import("../core/types.js").Role} [needed]
   */
  lacks(needed = "drive") {
    const { lease } = this.drive;
    if (needed === "drive" || !lease?.drives) return "";
    const isEnough = ROLES.indexOf(lease.role ?? "watch") >= ROLES.indexOf(needed);
    return isEnough ? "" : t("this needs the role {role}", { role: needed });
  }

  /**
   * Reason why a single command cannot be sent now. Watchers send no commands, and autonomous
   * motion does not start during STOP or while another operator drives.
   *
   * @param {boolean} moves
   */
  hindrance(moves = false) {
    if (moves) return this.against();
    const { lease } = this.drive;
    return lease?.drives === false ? said(lease.limit ?? "") || t("this page only watches") : "";
  }

  /**
   * Send a tick for a moved input immediately, without waiting for the next frame.
   *
   * @param {HeldControl} grip
   */
  moved(grip) {
    const { control } = grip;
    const nowMs = performance.now();
    if (control.phase !== "held" || nowMs - control.movedMs < SOONEST_MS) return;
    if (nowMs - this.frameMs > control.leaseMs) return; // delayed: the next frame ends the gesture
    control.movedMs = nowMs;
    grip.take(nowMs);
    this.stepOne(control, nowMs);
  }

  /** @param {HeldControl} grip */
  end(grip) {
    const { control } = grip;
    control.grips.delete(grip);
    if (control.grips.size === 0) {
      this.release(control);
      if (control.phase !== "spent") control.phase = "idle";
    }
    // A lever that keeps its position is released with the last held control.
    for (const other of [...control.grips]) other.check();
    grip.show();
  }

  /** @param {Control} control */
  release(control) {
    if (!control.isReleaseOwed) return;
    control.isReleaseOwed = false;
    this.drive.tell({ t: "release", command: control.command });
  }

  /**
   * End the gesture; the control has no effect until it is released and held again.
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
   * Release all held controls.
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

  /**
   * Release the held controls inside an element; others stay held.
   *
   * @param {Element} place
   * @param {string} reason shown by a dead-man control
   */
  letGoIn(place, reason) {
    for (const grip of this.grips) if (place.contains(grip.spec.el)) grip.drop(ANY);
    for (const gate of this.gates) {
      if (!place.contains(gate.grip.spec.el)) continue;
      gate.close(reason);
      gate.grip.drop(ANY);
    }
  }

  /** End all gestures after STOP or the loss of the socket. @param {string} reason */
  spendAll(reason) {
    for (const gate of this.gates) if (!gate.spec.isHeld) gate.close(reason);
    for (const control of this.controls.values()) {
      if (control.grips.size > 0 && control.phase !== "spent") this.spend(control, reason);
    }
  }

  /**
   * Handle a stop or a refusal by the server. The first reason for the end of a gesture stays,
   * because it also causes the refusal of ticks already sent.
   *
   * @param {string} command
   * @param {string} reason
   */
  stopped(command, reason) {
    const control = this.controls.get(command);
    if (!control) return;
    control.closedEpoch = this.drive.lease?.epoch ?? control.closedEpoch;
    control.isReleaseOwed = true;
    if (this.drive.isLatched) this.spend(control, this.against());
    else if (control.phase !== "spent" || !control.reason) this.spend(control, reason);
    if (control.grips.size === 0) this.release(control);
  }

  /**
   * Clear the last gesture's reason after a change of the lease. While STOP is latched, STOP is the
   * only reason, because only its reset helps.
   */
  leaseChanged() {
    for (const control of this.controls.values()) {
      if (control.phase !== "spent") continue;
      if (this.drive.isLatched) {
        this.spend(control, this.against());
        continue;
      }
      if (control.grips.size > 0) continue;
      control.phase = "idle";
      for (const grip of this.grips) if (grip.control === control) grip.show();
    }
  }

  /** Handle the refusal of a request about the controls. @param {string} reason */
  refused(reason) {
    for (const control of this.controls.values()) {
      if (control.phase === "asking") this.spend(control, reason);
    }
  }

  /** Start sampling, which ends with the last hold. */
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
   * Run one animation frame.
   *
   * @param {number} nowMs
   * @returns {boolean} whether another frame is needed
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
        this.spend(control, t("the page was blocked"));
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
      this.spend(control, this.refusal() || t("Control changed hands"));
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
    if (!drive.isFree) return; // wait for an empty buffer, so that the newest tick is sent first
    const { command, epoch, sight } = control;
    const sees = sight && this.images.report(sight.signal, nowMs);
    const tick = { t: "tick", command, arguments: values, epoch, echo: drive.beat, ...(sees && { sees }) };
    control.isReleaseOwed = drive.tell(tick, true);
    control.sent = text;
    control.sentMs = nowMs;
  }

  /** Whether the page shows no current image for a command that requires one. @param {number} nowMs */
  isBlind(nowMs) {
    const sights = [...this.grips].map(({ output: { sees } }) => sees);
    return sights.some((sight) => sight && this.images.share(sight, nowMs) === 0);
  }

  /**
   * Return why a held control moves more slowly than requested; "" if it does not.
   *
   * @param {Control} control
   */
  slowNote({ phase, sight }) {
    if (phase !== "held") return "";
    const nowMs = performance.now();
    const isOverridden = this.drive.overrideMs > nowMs;
    const seen = sight ? this.images.share(sight, nowMs) : 1;
    if (isOverridden && seen === 0) return t("Driving without an image");
    const image = isOverridden ? 1 : seen;
    const link = (this.drive.input?.percent ?? 100) / 100;
    const share = Math.min(image, link);
    if (share === 1) return "";
    const percent = Math.round(10 * share) * 10;
    return link < image ? t("Slow link: {percent} % of the speed", { percent }) : t("Old image: {percent} % of the speed", { percent });
  }

  /** @param {HeldControl} grip */
  forget(grip) {
    grip.drop(ANY);
    this.grips.delete(grip);
    if (this.last === grip) this.last = null;
  }
}
