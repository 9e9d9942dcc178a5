// @ts-check
/**
 * The common view of a setpoint for knob, slider and number field, with gestures on a dial or
 * track.
 *
 * @typedef {import("./setpoint.js").Setpoint} Setpoint
 */
import { grasp } from "../control/pointer_capture.js";
import { attribute, part, write } from "./kit.js";

export class SetpointView {
  /**
   * @param {HTMLElement} el the cell with `.NAME`, `.NAME-text` and `.NAME-note`
   * @param {string} name name of the widget
   */
  constructor(el, name) {
    this.root = part(el, `.${name}`);
    this.text = part(el, `.${name}-text`);
    this.note = part(el, `.${name}-note`);
    this.name = name;
    /** Elements that are disabled while it is locked. */
    this.locked = [...this.root.querySelectorAll("[aria-disabled]")];
  }

  /**
   * @param {Setpoint} setpoint
   * @param {string} [fault] error in the typed text
   */
  show(setpoint, fault = "") {
    const { root, text, note, locked } = this;
    attribute(root, "data-state", setpoint.state?.state ?? "none");
    attribute(root, "data-alarm", setpoint.state?.alarm ?? "");
    attribute(root, "data-phase", setpoint.giver.phase);
    attribute(root, "data-wish", setpoint.wishState);
    write(text, setpoint.text(setpoint.shown));
    write(note, [fault, setpoint.note()].filter(Boolean).join(" · "));
    const isLocked = String(!setpoint.giver.isReady);
    for (const one of locked) attribute(one, "aria-disabled", isLocked);
  }

  /**
   * Show the setpoint on an element with the role slider.
   *
   * @param {HTMLElement} control
   * @param {Setpoint} setpoint
   */
  showOn(control, setpoint) {
    const value = setpoint.shown;
    attribute(control, "aria-valuenow", String(value ?? setpoint.bounds.min));
    attribute(control, "aria-valuetext", setpoint.text(value));
  }

  /**
   * Allow gestures to set the value, on an element with the role slider and on the buttons
   * `.NAME-less` and `.NAME-more`.
   *
   * @param {HTMLElement} control
   * @param {Setpoint} setpoint
   * @param {(event: PointerEvent, isNew: boolean) => number} at returns the value under a pointer
   * @param {import("../control/pointer_capture.js").Way} way drag direction; other directions scroll the page
   * @param {AbortSignal} signal
   */
  listen(control, setpoint, at, way, signal) {
    attribute(control, "aria-valuemin", String(setpoint.bounds.min));
    attribute(control, "aria-valuemax", String(setpoint.bounds.max));
    const hold = grasp(control, {
      take(event) {
        if (!setpoint.giver.isReady) return false;
        event.preventDefault();
        control.focus();
        setpoint.move(at(event, true));
        return true;
      },
      move: (event) => setpoint.move(at(event, false)),
      release: () => setpoint.release(),
      cancel: () => setpoint.cancel(),
      way,
      signal,
    });
    setpoint.drop = () => hold.drop();
    control.addEventListener("keydown", (event) => {
      if (setpoint.key(event.key)) event.preventDefault();
    }, { signal });
    part(this.root, `.${this.name}-less`).addEventListener("click", () => setpoint.key("ArrowLeft"), { signal });
    part(this.root, `.${this.name}-more`).addEventListener("click", () => setpoint.key("ArrowRight"), { signal });
  }
}
