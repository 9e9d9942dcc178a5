// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Hand} Hand */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
import { gate, settingsOf, tilted } from "urc/response_curve";
import { attribute, drawing, part, write } from "urc/kit";
import { DIRECTIONS, Motion, pointed, pulled, signed } from "urc/motion";

/** Travel of the bubble, and size of the face, in units of the drawing. */
const TRAVEL = 74;
const FACE = 200;
/** Time limit for the first event of the sensor. */
const SENSOR_MS = 2000;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const { el } = ctx;
    if (!el.querySelector(".tilt-pad")) return {}; // no command is bound
    const sensor = new Sensor(ctx);
    const pad = new Pad(ctx, sensor);
    const motion = new Motion(ctx, "tilt", "moved");
    motion.hold({
      el: pad.el,
      keys: Object.values(DIRECTIONS).flat(),
      push: (hand, isNew) => pad.push(hand, isNew),
      draw: ({ push, values }) => pad.draw(push ?? {}, values),
    });
    return motion.instance();
  },
};

/** The tilt of the device, if it has a sensor and the operator has turned it on. */
class Sensor {
  /** @param {Context} ctx */
  constructor({ el, t, signal }) {
    this.t = t;
    this.signal = signal;
    this.root = part(el, ".tilt");
    this.button = part(el, ".tilt-use");
    this.state = part(el, ".tilt-state");
    this.isUsed = false;
    /** @type {{beta: number, gamma: number} | null} */
    this.now = null;
    this.button.addEventListener("click", () => void this.press(), { signal });
    addEventListener("deviceorientation", (event) => this.take(event), { signal });
    const missing = this.missing();
    if (missing) {
      attribute(this.button, "disabled", "");
      this.fault(missing);
    }
  }

  /** Return the reason why there is no sensor, or "". */
  missing() {
    if (!isSecureContext) {
      return this.t("Browsers offer the tilt sensor only to HTTPS pages: drag on the pad instead.");
    }
    return typeof DeviceOrientationEvent === "undefined"
      ? this.t("This browser has no tilt sensor: drag on the pad instead.")
      : "";
  }

  async press() {
    if (this.isUsed) {
      this.use(false);
      return;
    }
    try {
      // Some browsers require a permission, and only ask for it after a tap.
      const asks = /** @type {{requestPermission?: () => Promise<string>}} */ (
        /** @type {unknown} */ (DeviceOrientationEvent)
      );
      if (asks.requestPermission && (await asks.requestPermission()) !== "granted") {
        this.fault(this.t("Access to the tilt sensor was refused: drag on the pad instead."));
        return;
      }
    } catch (error) {
      this.fault(String(error instanceof Error ? error.message : error));
      return;
    }
    this.use(true);
    setTimeout(() => {
      if (this.signal.aborted || !this.isUsed || this.now) return;
      this.use(false);
      this.fault(this.t("This device has no tilt sensor: drag on the pad instead."));
    }, SENSOR_MS);
  }

  /** @param {boolean} isUsed */
  use(isUsed) {
    this.isUsed = isUsed;
    attribute(this.button, "aria-pressed", String(isUsed));
    attribute(this.root, "data-mode", isUsed ? "tilt" : "drag");
    attribute(this.state, "data-fault", null);
    const { t } = this;
    const hint = isUsed ? t("Hold the pad and tilt the device.") : t("Drag on the pad, or use the tilt sensor.");
    write(this.state, hint);
  }

  /** @param {string} text */
  fault(text) {
    attribute(this.state, "data-fault", "");
    write(this.state, `◆ ${text}`);
  }

  /** @param {DeviceOrientationEvent} event */
  take({ beta, gamma }) {
    if (beta !== null && gamma !== null) this.now = { beta, gamma };
  }
}

class Pad {
  /**
   * @param {Context} ctx
   * @param {Sensor} sensor
   */
  constructor({ el, options }, sensor) {
    this.sensor = sensor;
    this.el = part(el, ".tilt-pad");
    this.face = drawing(el, ".tilt-face");
    this.bubble = drawing(el, ".tilt-bubble");
    this.x = part(el, ".tilt-x");
    this.y = part(el, ".tilt-y");
    this.range = Number(options["range"] ?? 25);
    this.isSwapped = options["swap"] === true;
    this.keyLevel = Number(options["keys"] ?? 0.5);
    this.shape = settingsOf(options).gate;
    this.reach = 1;
    /** Tilt of the device at the start of the hold, which is the middle. */
    this.rest = sensor.now;
    this.isTilted = false;
  }

  /**
   * @param {Hand} hand
   * @param {boolean} isNew
   */
  push(hand, isNew) {
    if (isNew) {
      const { width, height } = this.face.getBoundingClientRect();
      this.reach = (Math.min(width, height) * TRAVEL) / FACE;
      this.rest = this.sensor.now;
      this.isTilted = this.sensor.isUsed; // fixed for the whole gesture
    }
    const { x, y } = this.where(hand);
    const [keptX, keptY] = this.isSwapped ? gate(y, x, this.shape) : gate(x, y, this.shape);
    return { push: { x: keptX, y: keptY }, isFine: hand.kind !== "keys" };
  }

  /**
   * @param {Hand} hand
   * @returns {{x: number, y: number}}
   */
  where(hand) {
    if (hand.kind === "keys") {
      const { x, y } = pointed(hand.keys);
      return { x: x * this.keyLevel, y: y * this.keyLevel };
    }
    if (!this.isTilted) return pulled(hand, this.reach);
    const { now } = this.sensor;
    if (!now || !this.rest) {
      this.rest = now; // the first event of the sensor is the middle
      return { x: 0, y: 0 };
    }
    return tilted(now, this.rest, screen.orientation?.angle ?? 0, this.range);
  }

  /**
   * @param {Record<string, number>} push
   * @param {Record<string, number>} values
   */
  draw({ x = 0, y = 0 }, values) {
    attribute(this.bubble, "transform", `translate(${(-y * TRAVEL).toFixed(1)} ${(-x * TRAVEL).toFixed(1)})`);
    write(this.x, signed(values["x"]));
    write(this.y, signed(values["y"]));
  }
}
