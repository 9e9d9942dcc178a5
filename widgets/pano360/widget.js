// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./look.js").Pose} Pose */
/** @typedef {import("./look.js").View} View */
/** @typedef {import("./stage.js").ViewSwitch} ViewSwitch */
import { DASH, attribute, button, faultOf, noteOf, part, write } from "urc/kit";
import { MOST_XMP, bearing, firstView, poseOf, tilted, turned } from "./look.js";
import { flat, sphere } from "./stage.js";

const STEP = 5;
/** Minimum interval between readings of the pose from a stream of images, in seconds. */
const POSE_EVERY_S = 1;
const SIDES = ["N", "NE", "E", "SE", "S", "SW", "W", "NW"];

export default {
  /**
   * @param {Context} ctx
   * @returns {Promise<Instance>}
   */
  async mount(ctx) {
    const stage = await makeStage(ctx.options["flat"] === true);
    if (ctx.signal.aborted) {
      stage.end();
      return {};
    }
    const pano = new Panorama(ctx, stage);
    return {
      update: ({ image }, { capture }) => pano.update(image, capture),
      resize: () => pano.resize(),
      destroy: () => stage.end(),
    };
  },
};

/**
 * @param {boolean} isFlat
 * @returns {Promise<ViewSwitch>}
 */
async function makeStage(isFlat) {
  if (isFlat) return flat();
  try {
    return sphere(await import("three"));
  } catch (error) {
    console.info("pano360: drawn flat, there is no WebGL:", error);
    return flat();
  }
}

class Panorama {
  /**
   * @param {Context} ctx
   * @param {ViewSwitch} stage
   */
  constructor(ctx, stage) {
    const { el, options, t, send, signal } = ctx;
    this.t = t;
    this.send = send;
    this.signal = signal;
    this.stage = stage;
    this.root = part(el, ".pano360");
    this.face = part(el, ".pano360-face");
    this.where = part(el, ".pano360-where");
    this.note = part(el, ".pano360-note");
    this.tools = part(el, ".pano360-more");
    /** @type {View} */
    this.home = turned(
      { yaw: 0, pitch: 0, fov: Number(options["field_of_view"] ?? 75) },
      { yaw: Number(options["yaw"] ?? 0), pitch: Number(options["pitch"] ?? 0) },
    );
    this.view = this.home;
    /** @type {Pose | null} */
    this.pose = null;
    this.poseS = -Infinity;
    this.hasPicture = false;
    this.hasMoved = false;
    this.isAsked = false;
    this.outcome = "";
    /** Note for the newest image if it is damaged. */
    this.fault = "";
    /** @type {Reading | undefined} */
    this.reading = undefined;
    stage.canvas.className = "pano360-picture urc-view-picture";
    stage.canvas.setAttribute("aria-hidden", "true");
    this.face.append(stage.canvas);
    this.resize();
    ctx.picture("image", (bitmap, reading) => this.show(bitmap, reading), (blob) => {
      this.fault = faultOf(blob, t);
      this.tell();
    });
    this.listen();
    if (options["tilt"] !== false) this.offerTilt();
  }

  /**
   * @param {ImageBitmap} bitmap
   * @param {Reading} reading
   */
  show(bitmap, reading) {
    this.hasPicture = true;
    this.fault = "";
    this.stage.show(bitmap, this.pose);
    this.stage.draw(this.view);
    this.tell();
    if (reading.image && reading.time - this.poseS >= POSE_EVERY_S) {
      this.poseS = reading.time;
      void this.readPose(reading.image.blob, bitmap);
    }
  }

  /**
   * @param {Blob} blob
   * @param {ImageBitmap} bitmap
   */
  async readPose(blob, bitmap) {
    const bytes = new Uint8Array(await blob.slice(0, MOST_XMP).arrayBuffer());
    if (this.signal.aborted) return;
    this.pose = poseOf(bytes);
    this.home = firstView(this.pose, this.home);
    if (!this.hasMoved) this.view = this.home;
    // 0: the bitmap is already closed, because a newer one has arrived.
    if (bitmap.width > 0) this.stage.show(bitmap, this.pose);
    this.ask();
  }

  listen() {
    const { face, signal } = this;
    /** @type {Map<number, {x: number, y: number}>} */
    const hands = new Map();
    const down = (/** @type {PointerEvent} */ event) => {
      hands.set(event.pointerId, { x: event.clientX, y: event.clientY });
      face.setPointerCapture(event.pointerId);
    };
    const move = (/** @type {PointerEvent} */ event) => {
      const from = hands.get(event.pointerId);
      if (!from) return;
      const to = { x: event.clientX, y: event.clientY };
      const other = [...hands.entries()].find(([id]) => id !== event.pointerId)?.[1];
      const scale = this.view.fov / Math.max(1, Math.min(face.clientWidth, face.clientHeight));
      if (other) {
        const [before, after] = [gap(from, other), gap(to, other)];
        if (before > 0 && after > 0) this.turn({ zoom: before / after });
      } else this.turn({ yaw: (to.x - from.x) * scale, pitch: (to.y - from.y) * scale });
      hands.set(event.pointerId, to);
    };
    const up = (/** @type {PointerEvent} */ event) => hands.delete(event.pointerId);
    face.addEventListener("pointerdown", down, { signal });
    face.addEventListener("pointermove", move, { signal });
    for (const name of /** @type {const} */ (["pointerup", "pointercancel", "lostpointercapture"])) {
      face.addEventListener(name, up, { signal });
    }
    face.addEventListener("keydown", (event) => this.key(event), { signal });
    const wheel = (/** @type {WheelEvent} */ event) => {
      event.preventDefault();
      this.turn({ zoom: event.deltaY > 0 ? 1.1 : 1 / 1.1 });
    };
    face.addEventListener("wheel", wheel, { signal, passive: false });
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const changes = {
      ArrowLeft: { yaw: STEP },
      ArrowRight: { yaw: -STEP },
      ArrowUp: { pitch: STEP },
      ArrowDown: { pitch: -STEP },
      "+": { zoom: 1 / 1.1 },
      "-": { zoom: 1.1 },
    };
    const change = Object.hasOwn(changes, event.key) ? Reflect.get(changes, event.key) : undefined;
    if (!change && event.key !== "Home") return;
    event.preventDefault();
    if (change) this.turn(change);
    else this.look(this.home);
  }

  /** @param {{yaw?: number, pitch?: number, zoom?: number}} change */
  turn(change) {
    this.look(turned(this.view, change));
  }

  /** @param {View} view */
  look(view) {
    this.hasMoved = true;
    this.view = view;
    this.ask();
  }

  /** Draw once in the next frame, and only after a change. */
  ask() {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      if (this.signal.aborted) return;
      this.stage.draw(this.view);
      this.tell();
    });
  }

  resize() {
    const { clientWidth, clientHeight } = this.face;
    if (clientWidth === 0 || clientHeight === 0) return;
    this.stage.resize(clientWidth, clientHeight);
    this.ask();
  }

  /**
   * @param {string} text
   * @param {string} name
   * @param {() => void} press
   */
  addButton(text, name, press) {
    const made = button("pano360-button urc-view-button", text, press, { signal: this.signal, label: name });
    this.tools.append(made);
    return made;
  }

  /** Add the button for tilting. Browsers allow the sensors only in secure contexts, some only after a tap. */
  offerTilt() {
    const Tilt = /** @type {any} */ (globalThis).DeviceOrientationEvent;
    if (!globalThis.isSecureContext || !Tilt || !matchMedia("(pointer: coarse)").matches) return;
    /** @type {AbortController | null} */
    let end = null;
    const button = this.addButton(this.t("Tilt"), this.t("Look around by tilting"), async () => {
      if (end) {
        end.abort();
        end = null;
      } else if (!Tilt.requestPermission || (await Tilt.requestPermission()) === "granted") {
        end = new AbortController();
        this.follow(AbortSignal.any([this.signal, end.signal]));
      }
      attribute(button, "aria-pressed", String(end !== null));
    });
    attribute(button, "aria-pressed", "false");
  }

  /** @param {AbortSignal} signal */
  follow(signal) {
    const from = this.view;
    /** @type {{alpha: number, beta: number} | null} */
    let start = null;
    const turn = (/** @type {DeviceOrientationEvent} */ { alpha, beta }) => {
      if (alpha === null || beta === null) return;
      start ??= { alpha, beta };
      this.look(turned(from, tilted({ alpha, beta }, start)));
    };
    globalThis.addEventListener("deviceorientation", turn, { signal });
  }

  /**
   * @param {Reading | undefined} reading
   * @param {Outlet | undefined} capture
   */
  update(reading, capture) {
    this.reading = reading;
    if (capture && !this.shutter) this.shutter = this.addButton(this.t("Capture"), "", () => void this.capture());
    if (this.shutter) this.shutter.disabled = !capture?.isReady;
    attribute(this.root, "data-state", reading?.state ?? "none");
    this.tell();
  }

  async capture() {
    this.outcome = `… ${this.t("sending")}`;
    this.tell();
    try {
      await this.send("capture");
      this.outcome = "";
    } catch (error) {
      this.outcome = `▲ ${error instanceof Error ? error.message : error}`;
    }
    this.tell();
  }

  tell() {
    const { reading, view, t } = this;
    const isShown = this.hasPicture && reading !== undefined && reading.value !== null;
    const heading = bearing(this.pose, view);
    const side = Number.isNaN(heading) ? "" : `${SIDES[Math.round(heading / 45) % 8]} ${Math.round(heading) % 360}°`;
    const [yaw, pitch] = [Math.round(view.yaw), Math.round(view.pitch)];
    const across = yaw > 0 ? t("left {n}°", { n: yaw }) : yaw < 0 ? t("right {n}°", { n: -yaw }) : t("ahead");
    const up = pitch > 0 ? t("up {n}°", { n: pitch }) : pitch < 0 ? t("down {n}°", { n: -pitch }) : "";
    write(this.where, isShown ? [side || across, up].filter(Boolean).join(" · ") : DASH);
    const note = !reading || reading.state === "none" ? t("no picture yet") : noteOf(reading, t);
    write(this.note, [this.outcome, this.fault, note].filter(Boolean).join(" · "));
  }
}

/**
 * @param {{x: number, y: number}} one
 * @param {{x: number, y: number}} other
 */
function gap(one, other) {
  return Math.hypot(one.x - other.x, one.y - other.y);
}
