// @ts-check
/** The layer that is rarely redrawn: rings, vehicle, zones and compass. */
import { board, format } from "urc/kit";
import { ARC } from "./paint.js";
import { ringStep } from "./rays.js";

/**
 * @typedef {object} Scene
 * @property {number} width
 * @property {number} height
 * @property {string} view
 * @property {number} most
 * @property {number} near
 * @property {number} stop
 * @property {unknown} vehicle length and width
 * @property {number} heading degrees clockwise from north; NaN if unknown
 * @property {{symbol: string, factor: (value: number) => number}} unit
 * @property {Record<string, string> | undefined} ink
 */

const FONT = "600 12px system-ui, sans-serif";

export class Overlay {
  /** @param {HTMLCanvasElement} canvas */
  constructor(canvas) {
    this.canvas = canvas;
    this.drawn = "";
  }

  /** @param {Scene} scene */
  draw(scene) {
    const look = JSON.stringify([scene, Math.round(scene.heading), scene.unit.symbol]);
    if (look === this.drawn) return;
    this.drawn = look;
    const pen = board(this.canvas, scene);
    pen.font = FONT;
    pen.lineWidth = 1;
    if (scene.view === "graph") rows(pen, scene);
    else if (scene.view === "depth") middle(pen, scene);
    else {
      pen.translate(scene.width / 2, scene.height / 2);
      const radius = Math.min(scene.width, scene.height) / 2;
      if (scene.view === "arc") compass(pen, scene, radius);
      else rings(pen, scene, radius);
      vehicle(pen, scene, scene.view === "arc" ? 0 : radius / scene.most, radius);
    }
  }
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {Scene} scene
 * @param {number} radius
 */
function rings(pen, { most, near, stop, ink }, radius) {
  const step = ringStep(most, 4);
  const circle = (/** @type {number} */ distance) => {
    pen.beginPath();
    pen.arc(0, 0, (radius * distance) / most, 0, 2 * Math.PI);
    pen.stroke();
  };
  pen.strokeStyle = ink?.["line"] ?? "";
  pen.globalAlpha = 0.5;
  for (let distance = step; distance <= most * 1.001; distance += step) circle(distance);
  pen.globalAlpha = 1;
  for (const [distance, name, dash] of /** @type {[number, string, number[]][]} */ ([[near, "caution", [8, 5]], [stop, "alarm", [3, 3]]])) {
    if (!(distance > 0) || distance >= most) continue;
    pen.strokeStyle = ink?.[name] ?? "";
    pen.setLineDash(dash);
    circle(distance);
  }
  pen.setLineDash([]);
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {Scene} scene
 * @param {number} scale pixels for each unit; 0 draws a symbol without scale
 * @param {number} radius
 */
function vehicle(pen, { vehicle: given, ink }, scale, radius) {
  const [length, width] = Array.isArray(given) ? given.map(Number) : [];
  const isDrawn = scale > 0 && length !== undefined && width !== undefined;
  const [long, wide] = isDrawn ? [length * scale, width * scale] : [radius * 0.12, radius * 0.08];
  pen.strokeStyle = ink?.["text"] ?? "";
  pen.lineWidth = 1.5;
  pen.beginPath();
  pen.moveTo(0, -long / 2);
  pen.lineTo(wide / 2, -long / 4);
  pen.lineTo(wide / 2, long / 2);
  pen.lineTo(-wide / 2, long / 2);
  pen.lineTo(-wide / 2, -long / 4);
  pen.closePath();
  pen.stroke();
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {Scene} scene
 * @param {number} radius
 */
function compass(pen, { heading, ink }, radius) {
  pen.strokeStyle = ink?.["line"] ?? "";
  pen.fillStyle = ink?.["text"] ?? "";
  pen.textAlign = "center";
  pen.textBaseline = "middle";
  for (const share of [ARC.inner, ARC.outer]) {
    pen.beginPath();
    pen.arc(0, 0, radius * share, 0, 2 * Math.PI);
    pen.stroke();
  }
  // Without a heading, the ring shows the robot's own left and right.
  const isKnown = Number.isFinite(heading);
  const words = isKnown ? ["N", "E", "S", "W"] : ["0", "−90", "180", "90"];
  for (let tick = 0; tick < 36; tick += 1) {
    const angle = ((10 * tick - (isKnown ? heading : 0) - 90) * Math.PI) / 180;
    const [x, y] = [Math.cos(angle), Math.sin(angle)];
    const long = tick % 9 === 0 ? 0.06 : 0.03;
    pen.beginPath();
    pen.moveTo(x * radius * ARC.outer, y * radius * ARC.outer);
    pen.lineTo(x * radius * (ARC.outer + long), y * radius * (ARC.outer + long));
    pen.stroke();
    if (tick % 9 === 0) pen.fillText(words[tick / 9] ?? "", x * radius * 0.94, y * radius * 0.94);
  }
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {Scene} scene
 */
function rows(pen, { width, height, most, unit, ink }) {
  const step = ringStep(most, 4);
  pen.fillStyle = ink?.["text"] ?? "";
  pen.lineJoin = "round";
  for (let distance = 0; distance <= most * 1.001; distance += step) {
    const y = height * (1 - distance / most);
    pen.strokeStyle = ink?.["line"] ?? "";
    pen.lineWidth = 1;
    pen.globalAlpha = 0.5;
    pen.beginPath();
    pen.moveTo(0, y);
    pen.lineTo(width, y);
    pen.stroke();
    pen.globalAlpha = 1;
    if (distance === 0) continue;
    // With an edge, so that the curve does not cross the figure.
    const words = `${format(unit.factor(distance))} ${unit.symbol}`.trim();
    pen.strokeStyle = ink?.["raised"] ?? "";
    pen.lineWidth = 4;
    pen.strokeText(words, 3, y + 12);
    pen.fillText(words, 3, y + 12);
  }
}

/**
 * @param {CanvasRenderingContext2D} pen
 * @param {Scene} scene
 */
function middle(pen, { width, height, ink }) {
  pen.strokeStyle = ink?.["line"] ?? "";
  pen.beginPath();
  pen.moveTo(0, height / 2);
  pen.lineTo(width, height / 2);
  pen.stroke();
}
