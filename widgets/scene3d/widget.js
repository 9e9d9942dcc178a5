// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Picture} Picture */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./model.js").Model} Model */
/** @typedef {import("./pose.js").Quaternion} Quaternion */
import { DASH, attribute, colours, many, noteOf, number, part, write } from "urc/kit";
import { coloursOf, placesOf, readCloud } from "./cloud.js";
import { box, urdf } from "./model.js";
import { angles, cloud, fromAngles, fromOrientation, posture } from "./pose.js";
import { ViewSwitch } from "./stage.js";

const STEP = Math.PI / 24;
const VIEWS = /** @type {const} */ (["follow", "top", "orbit"]);
/**
 * Mark a text for the catalogues; it is translated elsewhere.
 *
 * @param {string} text
 */
const mark = (text) => text;
const NAMES = { follow: mark("Follow"), top: mark("From above"), orbit: mark("Free view") };
const KEYS = {
  ArrowLeft: [-STEP, 0, 1],
  ArrowRight: [STEP, 0, 1],
  ArrowUp: [0, STEP, 1],
  ArrowDown: [0, -STEP, 1],
  "+": [0, 0, 0.9],
  "-": [0, 0, 1.1],
};

export default {
  /**
   * @param {Context} ctx
   * @returns {Promise<Instance>}
   */
  async mount(ctx) {
    const [three, { OrbitControls }] = await Promise.all([
      import("three"),
      import("three/addons/controls/OrbitControls.js"),
    ]);
    if (ctx.signal.aborted) return {};
    const scene = new Scene(ctx, three, OrbitControls);
    ctx.follow("theme", () => scene.theme());
    void scene.load();
    return {
      update: (readings) => scene.update(readings),
      resize: () => scene.resize(),
      destroy: () => scene.stage?.end(),
    };
  },
};

class Scene {
  /**
   * @param {Context} ctx
   * @param {typeof import("three")} three
   * @param {typeof import("three/addons/controls/OrbitControls.js").OrbitControls} Controls
   */
  constructor({ el, options, t, signal }, three, Controls) {
    this.t = t;
    this.three = three;
    this.options = options;
    this.signal = signal;
    this.root = part(el, ".scene3d");
    this.face = part(el, ".scene3d-face");
    this.text = part(el, ".scene3d-text");
    this.joints = part(el, ".scene3d-joints");
    this.note = part(el, ".scene3d-note");
    /** @type {import("./pose.js").Convention} */
    this.convention = options["convention"] === "FRD" ? "FRD" : "FLU";
    this.fault = "";
    /** @type {Model | null} */
    this.model = null;
    /** @type {Readonly<Record<string, Reading>>} */
    this.readings = {};
    this.seen = "";
    /** Last known rotation. @type {Quaternion} */
    this.turned = [0, 0, 0, 1];
    /** @type {[number, number, number]} */
    this.at = [0, 0, 0];
    /** Whether the position of the camera shows the first known posture. */
    this.isFitted = false;
    /** Serial number of the drawn points; -1 without points. */
    this.pointsSerial = -1;
    /** Newest point cloud. @type {Picture | null} */
    this.cloudPicture = null;
    /** Last decoded point cloud. @type {import("./cloud.js").Cloud | null} */
    this.cloud = null;
    this.isReading = false;
    this.isCloudBad = false;
    /** Description of the robot as URDF, or "". */
    this.description = "";
    /** Number of the newest model; an older one that loads late is dropped. */
    this.loads = 0;
    const view = VIEWS.find((each) => each === options["view"]) ?? "orbit";
    try {
      this.stage = new ViewSwitch(three, Controls, this.face, { frames: Number(options["frames"] ?? 30), view });
    } catch {
      // The text below still describes the pose.
      this.stage = null;
      this.fault = t("this browser does not support WebGL");
      return;
    }
    this.stage.canvas.className = "scene3d-picture";
    this.stage.canvas.setAttribute("aria-hidden", "true");
    this.face.append(this.stage.canvas);
    this.addButton();
    this.face.addEventListener("keydown", (event) => this.key(event), { signal });
    this.theme();
    this.resize();
  }

  addButton() {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "scene3d-view urc-scene-view";
    button.dataset["floats"] = "";
    const label = () => {
      const name = this.t(NAMES[this.stage?.view ?? "orbit"]);
      write(button, name);
      attribute(button, "aria-label", this.t("View: {name}. Change it.", { name }));
    };
    const press = () => {
      const { stage } = this;
      if (!stage) return;
      stage.look(VIEWS[(VIEWS.indexOf(stage.view) + 1) % VIEWS.length] ?? "orbit");
      attribute(this.root, "data-view", stage.view);
      this.seen = "";
      this.place();
      label();
    };
    label();
    button.addEventListener("click", press, { signal: this.signal });
    part(this.root, ".scene3d-tools").append(button);
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const change = Object.hasOwn(KEYS, event.key) ? Reflect.get(KEYS, event.key) : undefined;
    if (!change || this.stage?.view !== "orbit") return;
    event.preventDefault();
    this.stage.orbit(change[0], change[1], change[2]);
  }

  theme() {
    this.stage?.theme(colours(this.root, ["line", "caution"]));
    this.inks = colours(this.root, ["series-1", "series-2", "series-4"]);
    this.showCloud();
  }

  resize() {
    const { clientWidth, clientHeight } = this.face;
    if (clientWidth > 0 && clientHeight > 0) this.stage?.resize(clientWidth, clientHeight);
  }

  async load() {
    const { options, stage, three } = this;
    if (!stage) return;
    const size = Array.isArray(options["box"]) ? options["box"] : [];
    const file = options["urdf"];
    const source = this.description ? { text: this.description } : typeof file === "string" && file ? { url: file } : null;
    const turn = (this.loads += 1);
    this.fault = "";
    let model = box(three, size);
    if (source) {
      const meshes = Array.isArray(options["meshes"]) ? options["meshes"].map(String) : [];
      const changed = () => {
        if (this.signal.aborted) return;
        stage.measure();
        this.seen = "";
        this.place();
        this.tell();
      };
      try {
        model = await urdf(three, source, meshes, changed);
      } catch (error) {
        this.fault = error instanceof Error ? error.message : String(error);
      }
    }
    if (this.signal.aborted || turn !== this.loads) return;
    this.model = model;
    stage.setModel(model.object);
    attribute(this.root, "data-model", model.joints.length > 0 || model.missing.length > 0 ? "urdf" : "box");
    this.seen = "";
    this.place();
    this.tell();
  }

  /** @param {Readonly<Record<string, Reading>>} readings */
  update(readings) {
    this.readings = readings;
    const text = readings["description"]?.value;
    if (typeof text === "string" && text !== this.description) {
      this.description = text;
      void this.load();
    }
    // Robots send their description only once, so its age does not matter.
    const shown = Object.entries(readings).filter(([name]) => name !== "description");
    const all = shown.flatMap(([, each]) => each);
    // The worst bound reading determines the state.
    this.worst = all.reduce((/** @type {Reading | undefined} */ found, each) => worse(found, each), undefined);
    attribute(this.root, "data-state", this.worst?.state ?? "none");
    this.place();
    this.setPoints();
    this.setCloud();
    this.tell();
  }

  /** Set pose and joints from the readings. Unknown values do not change them. */
  place() {
    const { readings, stage, model } = this;
    if (!stage) return;
    const values = this.jointValues();
    const turn = (this.turned = this.turn() ?? this.turned);
    const [x, y, z] = this.at;
    this.at = [number(readings["x"]) ?? x, number(readings["y"]) ?? y, number(readings["z"]) ?? z];
    const look = JSON.stringify([values, turn, this.at]);
    if (look === this.seen) return;
    this.seen = look;
    const given = this.options["joint_names"];
    const names = Array.isArray(given) ? given.map(String) : (model?.joints ?? []);
    values.forEach((value, index) => {
      const name = names[index];
      if (model && name !== undefined && value !== null) model.set(name, value);
    });
    stage.setPose(this.at, turn, angles(turn).yaw);
    if (model && !this.isFitted && values.some((value) => value !== null)) {
      this.isFitted = true;
      stage.measure();
    }
  }

  /** @returns {(number | null)[]} */
  jointValues() {
    const list = this.readings["joints"]?.value;
    const singles = many(this.readings["joint"]).map((each) => number(each));
    const first = Array.isArray(list) ? list.map((each) => (typeof each === "number" ? each : null)) : [];
    return [...first, ...singles];
  }

  /** Rotation of the robot, or null if a part is unknown. @returns {Quaternion | null} */
  turn() {
    const { readings, convention } = this;
    const whole = fromOrientation(readings["orientation"]?.value, convention);
    if (whole) return whole;
    const bound = ["roll", "pitch", "yaw"].filter((name) => readings[name] !== undefined);
    if (bound.length === 0 || bound.some((name) => number(readings[name]) === null)) return null;
    const [roll = 0, pitch = 0, yaw = 0] = ["roll", "pitch", "yaw"].map((name) => number(readings[name]) ?? 0);
    return fromAngles(roll, pitch, yaw, convention);
  }

  setPoints() {
    const reading = this.readings["points"];
    const values = Array.isArray(reading?.value) ? reading.value : [];
    // Outdated points are removed, even without newer points.
    const serial = reading && reading.value !== null ? reading.serial : -1;
    if (!this.stage || serial === this.pointsSerial) return;
    this.pointsSerial = serial;
    this.stage.setPoints(cloud(values, Number(this.options["budget"] ?? 20000), this.convention));
  }

  setCloud() {
    const picture = this.readings["cloud"]?.image ?? null;
    if (!this.stage || picture?.serial === this.cloudPicture?.serial) return;
    this.cloudPicture = picture;
    if (picture) void this.readClouds();
    else {
      [this.cloud, this.isCloudBad] = [null, false];
      this.showCloud();
    }
  }

  /** Decode the newest point cloud; a newer one waits for its turn. */
  async readClouds() {
    if (this.isReading) return;
    this.isReading = true;
    let /** @type {Picture | null} */ seen = null;
    while (!this.signal.aborted && this.cloudPicture && this.cloudPicture !== seen) {
      seen = this.cloudPicture;
      try {
        const cloud = readCloud(await seen.blob.arrayBuffer());
        if (!this.cloudPicture) break; // meanwhile too old to be shown
        [this.cloud, this.isCloudBad] = [cloud, false];
      } catch {
        [this.cloud, this.isCloudBad] = [null, true];
      }
      if (!this.signal.aborted) this.showCloud();
    }
    this.isReading = false;
  }

  showCloud() {
    const { cloud, inks, options, stage, three } = this;
    if (!stage) return;
    const places = cloud ? placesOf(cloud, Number(options["budget"] ?? 20000), this.convention) : new Float32Array(0);
    const stops = inks ? [inks["series-1"], inks["series-2"], inks["series-4"]].map((ink) => new three.Color(ink)) : [];
    const mixed = new three.Color();
    const ramp = (/** @type {number} */ share) => {
      const [from, to] = share < 0.5 ? [stops[0], stops[1]] : [stops[1], stops[2]];
      if (from && to) mixed.lerpColors(from, to, share < 0.5 ? 2 * share : 2 * share - 1);
      return /** @type {const} */ ([mixed.r, mixed.g, mixed.b]);
    };
    const by = options["colour"] === "height" ? "height" : "field";
    stage.setCloud(places, cloud ? coloursOf(cloud, places, by, ramp) : new Float32Array(0));
    attribute(this.root, "data-points", cloud ? String(places.length / 3) : null);
    this.tell();
  }

  tell() {
    const { worst, model, t } = this;
    const turn = this.turn();
    const words = turn ? posture(turn).map(({ text, degrees }) => t(text, { n: degrees })) : [];
    const isTurned = ["orientation", "roll", "pitch", "yaw"].some((name) => this.readings[name] !== undefined);
    attribute(this.root, "data-pose", isTurned && !turn ? "unknown" : null);
    const joints = this.jointValues().filter((each) => each !== null).length;
    const isShown = worst !== undefined && (worst.state === "live" || worst.state === "stale");
    const bent = joints > 0 ? t("joints: {count}", { count: joints }) : "";
    const level = turn && words.length === 0 ? t("level") : "";
    const points = this.cloud ? t("points: {count}", { count: this.cloud.count }) : "";
    const said = [level, ...words, points].filter(Boolean).join(" · ");
    write(this.text, isShown && (said || bent) ? said : DASH);
    write(this.joints, isShown ? bent : "");
    const count = model?.missing.length ?? 0;
    const missing = count > 0 ? ["◆", t("missing shapes: {count}", { count })].join(" ") : "";
    const note = worst ? noteOf(worst, t) : "";
    const bad = this.isCloudBad ? `▲ ${t("not a point cloud")}` : "";
    write(this.note, [this.fault ? `▲ ${this.fault}` : "", bad, missing, note].filter(Boolean).join(" · "));
  }
}

const RANK = ["live", "stale", "gone", "none"];

/**
 * @param {Reading | undefined} one
 * @param {Reading} other
 */
function worse(one, other) {
  return !one || RANK.indexOf(other.state) > RANK.indexOf(one.state) ? other : one;
}
