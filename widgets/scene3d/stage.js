// @ts-check
/**
 * The scene: light, ground, robot, points and camera. The scene draws only on request, at a limited rate.
 *
 * @typedef {typeof import("three")} Three
 * @typedef {import("three").Object3D} Object3D
 * @typedef {import("./pose.js").Quaternion} Quaternion
 * @typedef {import("./pose.js").Vector} Vector
 */
import { cameraAt } from "./pose.js";

const MOST_DENSITY = 1.5;
/** Extent of the ground to each side, in metres. */
const REACH = 10;

export class ViewSwitch {
  /**
   * @param {Three} three
   * @param {typeof import("three/addons/controls/OrbitControls.js").OrbitControls} Controls
   * @param {HTMLElement} face
   * @param {{frames: number, view: "follow" | "top" | "orbit"}} given
   */
  constructor(three, Controls, face, { frames, view }) {
    this.three = three;
    this.everyMs = 1000 / frames;
    this.renderer = new three.WebGLRenderer({ antialias: true, alpha: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(MOST_DENSITY, globalThis.devicePixelRatio || 1));
    this.canvas = this.renderer.domElement;
    this.scene = new three.Scene();
    this.camera = new three.PerspectiveCamera(45, 1, 0.01, 1000);
    this.camera.up.set(0, 0, 1);
    this.scene.add(new three.HemisphereLight(0xffffff, 0x555555, 2.2));
    const sun = new three.DirectionalLight(0xffffff, 1.4);
    sun.position.set(2, 3, 5);
    this.scene.add(sun);
    this.robot = new three.Group();
    this.scene.add(this.robot);
    this.ground = this.makeGround(0x808890);
    this.points = this.makePoints();
    this.cloud = this.makePoints();
    this.cloud.material.color.set(0xffffff);
    this.cloud.material.vertexColors = true;
    this.robot.add(this.points, this.cloud);
    this.controls = new Controls(this.camera, this.canvas);
    this.controls.enableDamping = false;
    this.controls.addEventListener("change", () => this.ask());
    this.size = 1;
    /** Centre of the model, relative to the robot's position. */
    this.centre = new three.Vector3();
    this.view = view;
    this.drawnMs = -Infinity;
    this.isAsked = false;
    this.isOver = false;
    this.drawn = 0;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.timer = undefined;
    this.look(view);
  }

  /** @param {number} colour */
  makeGround(colour) {
    // In pieces of one metre: software renderers lose a long line that begins behind the camera.
    const ends = [];
    for (let line = -REACH; line <= REACH; line += 1) {
      for (let piece = -REACH; piece < REACH; piece += 1) {
        ends.push(line, piece, 0, line, piece + 1, 0, piece, line, 0, piece + 1, line, 0);
      }
    }
    const geometry = new this.three.BufferGeometry();
    geometry.setAttribute("position", new this.three.Float32BufferAttribute(ends, 3));
    const material = new this.three.LineBasicMaterial({ color: colour, transparent: true, opacity: 0.5 });
    const ground = new this.three.LineSegments(geometry, material);
    this.scene.add(ground);
    return ground;
  }

  makePoints() {
    const { three } = this;
    const material = new three.PointsMaterial({ size: 3, sizeAttenuation: false, color: 0xf0b23e });
    const points = new three.Points(new three.BufferGeometry(), material);
    points.frustumCulled = false;
    return points;
  }

  /** @param {{line: string, caution: string}} ink */
  theme({ line, caution }) {
    this.ground.material.color.set(line);
    this.points.material.color.set(caution);
    this.ask();
  }

  /** @param {Object3D} object */
  setModel(object) {
    if (this.model) this.robot.remove(this.model);
    this.model = object;
    this.robot.add(object);
    this.measure();
  }

  /** Measure the model. Its size and centre determine the position of the camera. */
  measure() {
    if (!this.model) return;
    const turn = this.robot.quaternion.clone();
    this.robot.quaternion.identity();
    this.robot.updateMatrixWorld(true);
    const extent = new this.three.Box3().setFromObject(this.model);
    const size = extent.getSize(new this.three.Vector3()).length();
    this.robot.quaternion.copy(turn);
    const isKnown = Number.isFinite(size) && size > 0;
    this.size = isKnown ? size : 1;
    this.centre.set(0, 0, 0);
    if (isKnown) extent.getCenter(this.centre).sub(this.robot.position);
    this.look(this.view);
  }

  /** @param {Float32Array} places */
  setPoints(places) {
    this.fill(this.points, { position: places });
  }

  /**
   * Show a point cloud with colours; both lists have three numbers for each point.
   *
   * @param {Float32Array} places
   * @param {Float32Array} colours
   */
  setCloud(places, colours) {
    this.fill(this.cloud, { position: places, color: colours });
  }

  /**
   * @param {import("three").Points} points
   * @param {Record<string, Float32Array>} given
   */
  fill(points, given) {
    const { three } = this;
    let count = 0;
    for (const [name, values] of Object.entries(given)) {
      count = values.length / 3;
      const old = points.geometry.getAttribute(name);
      if (old && old.array.length >= values.length && count > 0) {
        old.array.set(values);
        old.needsUpdate = true;
        continue;
      }
      if (old) {
        points.geometry.dispose();
        points.geometry = new three.BufferGeometry();
      }
      points.geometry.setAttribute(name, new three.BufferAttribute(values.slice(), 3));
    }
    points.geometry.setDrawRange(0, count);
    this.ask();
  }

  /**
   * @param {Vector} place
   * @param {Quaternion} turn
   * @param {number} yaw
   */
  setPose(place, turn, yaw) {
    const moved = new this.three.Vector3(...place).sub(this.robot.position);
    this.robot.position.set(...place);
    this.robot.quaternion.set(...turn);
    // The ground follows the robot in whole squares, so that it never ends.
    this.ground.position.set(Math.round(place[0]), Math.round(place[1]), 0);
    if (this.view === "orbit") {
      this.camera.position.add(moved);
      this.controls.target.copy(this.robot.position).add(this.centre);
      this.controls.update();
    } else this.stand(yaw);
    this.ask();
  }

  /** @param {"follow" | "top" | "orbit"} view */
  look(view) {
    this.view = view;
    this.controls.enabled = view === "orbit";
    this.stand(0);
    this.ask();
  }

  /** @param {number} yaw */
  stand(yaw) {
    const target = this.robot.position.clone().add(this.centre);
    const [x, y, z] = cameraAt(this.view, yaw, this.size);
    this.camera.up.set(this.view === "top" ? 1 : 0, 0, this.view === "top" ? 0 : 1);
    this.camera.position.set(target.x + x, target.y + y, target.z + z);
    this.camera.lookAt(target);
    this.controls.target.copy(target);
  }

  /**
   * Move the camera by keys.
   *
   * @param {number} across radians
   * @param {number} up radians
   * @param {number} zoom factor of the distance
   */
  orbit(across, up, zoom) {
    const { three } = this;
    const from = this.camera.position.clone().sub(this.controls.target);
    const flat = Math.hypot(from.x, from.y);
    const far = Math.min(500, Math.max(0.05, from.length() * zoom));
    const turn = Math.atan2(from.y, from.x) + across;
    const lift = Math.min(1.5, Math.max(-1.5, Math.atan2(from.z, flat) + up));
    const place = new three.Vector3(Math.cos(turn) * Math.cos(lift), Math.sin(turn) * Math.cos(lift), Math.sin(lift));
    this.camera.position.copy(place.multiplyScalar(far).add(this.controls.target));
    this.camera.lookAt(this.controls.target);
    this.ask();
  }

  /**
   * @param {number} width
   * @param {number} height
   */
  resize(width, height) {
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
    this.ask();
  }

  /** Draw in a later frame, at most at the frame rate. */
  ask() {
    if (this.isAsked || this.isOver) return;
    this.isAsked = true;
    const waitMs = this.drawnMs + this.everyMs - performance.now();
    const draw = () => requestAnimationFrame(() => this.draw());
    if (waitMs > 4) this.timer = setTimeout(draw, waitMs);
    else draw();
  }

  draw() {
    this.isAsked = false;
    if (this.isOver) return;
    this.drawnMs = performance.now();
    this.drawn += 1;
    this.renderer.render(this.scene, this.camera);
    this.canvas.dataset["frames"] = String(this.drawn);
  }

  end() {
    this.isOver = true;
    clearTimeout(this.timer);
    this.controls.dispose();
    this.scene.traverse((object) => {
      const { geometry, material } = /** @type {any} */ (object);
      geometry?.dispose();
      for (const each of [material].flat()) each?.dispose?.();
    });
    this.renderer.dispose();
    this.renderer.forceContextLoss(); // browsers allow only about sixteen contexts
  }
}
