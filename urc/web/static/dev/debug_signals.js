// @ts-check
/**
 * All signals in a table. Hundreds of signals need little time, because only visible rows are
 * written, at most ten times a second, and only after a change.
 *
 * @typedef {import("../live/store.js").Store} Store
 * @typedef {import("../core/types.js").Reading} Reading
 *
 * @typedef {object} Row
 * @property {HTMLElement} el
 * @property {string} name
 * @property {HTMLElement} value
 * @property {HTMLElement} alarm
 * @property {HTMLElement} age
 * @property {HTMLCanvasElement | null} canvas
 * @property {(number | null)[]} past one value per second, oldest first
 * @property {boolean} isVisible
 */
import { DASH, alarmText, attribute, t, write } from "urc/kit";
import { part } from "../live/badge.js";
import { visible } from "./bytes.js";
import { PICTURES, ageText } from "../live/store.js";

const WRITE_EVERY_MS = 100;
const SAMPLE_EVERY_MS = 1000;
const SAMPLES = 60;
const SHOWN_CHARACTERS = 200;

export class DebugSignals {
  /**
   * @param {HTMLElement} el
   * @param {Store} store
   * @param {AbortSignal} over
   */
  constructor(el, store, over) {
    this.store = store;
    this.writtenMs = -Infinity;
    this.sampledMs = -Infinity;
    /** @type {Map<Element, Row>} */
    this.rows = new Map();
    for (const row of el.querySelectorAll("[data-signal]")) {
      if (row instanceof HTMLElement) this.rows.set(row, rowOf(row));
    }
    const sight = new IntersectionObserver((entries) => {
      for (const { target, isIntersecting } of entries) {
        const row = this.rows.get(target);
        if (row) row.isVisible = isIntersecting;
      }
      this.writtenMs = -Infinity;
    });
    for (const row of this.rows.keys()) sight.observe(row);
    over.addEventListener("abort", () => sight.disconnect());
    const find = el.querySelector("[data-find-signal]");
    find?.addEventListener("input", () => find instanceof HTMLInputElement && this.find(find.value));
  }

  /** @param {string} text */
  find(text) {
    const wanted = text.trim().toLowerCase();
    for (const { el } of this.rows.values()) el.hidden = !(el.dataset["words"] ?? "").includes(wanted);
  }

  /** Return the names of images in visible rows, because the server sends only these. */
  pictures() {
    if (!this.store.hasPictures) return [];
    const seen = [...this.rows.values()].filter((row) => row.isVisible).map((row) => row.name);
    return seen.filter((name) => PICTURES.has(this.store.signals.get(name)?.type ?? ""));
  }

  /** @param {number} nowMs */
  frame(nowMs) {
    if (nowMs - this.writtenMs < WRITE_EVERY_MS) return;
    this.writtenMs = nowMs;
    const isSampling = nowMs - this.sampledMs >= SAMPLE_EVERY_MS;
    if (isSampling) this.sampledMs = nowMs;
    for (const row of this.rows.values()) {
      const isSampled = isSampling && row.canvas !== null;
      if (!row.isVisible && !isSampled) continue;
      const reading = this.store.reading(row.name, nowMs);
      if (isSampled) sample(row, reading);
      if (!row.isVisible) continue;
      attribute(row.el, "data-state", reading.state);
      write(row.value, shown(reading));
      write(row.alarm, alarmText(reading, t));
      attribute(row.alarm, "data-alarm", reading.alarm);
      write(row.age, reading.state === "none" ? DASH : ageText(nowMs / 1000 - reading.time));
      if (isSampled) draw(row);
    }
  }
}

/**
 * @param {HTMLElement} el
 * @returns {Row}
 */
function rowOf(el) {
  const canvas = el.querySelector("[data-spark]");
  return {
    el,
    name: el.dataset["signal"] ?? "",
    value: part(el, "[data-value]"),
    alarm: part(el, "[data-alarm]"),
    age: part(el, "[data-age]"),
    canvas: canvas instanceof HTMLCanvasElement ? canvas : null,
    past: [],
    isVisible: false,
  };
}

/** @param {Reading} reading */
function shown(reading) {
  /** @type {unknown} */
  const value = reading.value;
  if (value !== null && typeof value === "object") {
    if ("bytes" in value) return `<${String(value.bytes)} bytes>`;
    return visible(JSON.stringify(value).slice(0, SHOWN_CHARACTERS));
  }
  const unit = reading.unit && value !== null ? ` ${reading.unit}` : "";
  return visible(reading.text.slice(0, SHOWN_CHARACTERS)) + unit;
}

/**
 * @param {Row} row
 * @param {Reading} reading
 */
function sample(row, { value }) {
  const number = typeof value === "boolean" ? Number(value) : value;
  row.past.push(typeof number === "number" && Number.isFinite(number) ? number : null);
  if (row.past.length > SAMPLES) row.past.shift();
}

/** @param {Row} row */
function draw({ canvas, past }) {
  const pen = canvas?.getContext("2d");
  if (!canvas || !pen) return;
  const known = past.filter((one) => one !== null);
  const [least, most] = [Math.min(...known), Math.max(...known)];
  const { width, height } = canvas;
  pen.clearRect(0, 0, width, height);
  pen.strokeStyle = getComputedStyle(canvas).color;
  pen.lineWidth = 1.5;
  pen.beginPath();
  let isDown = false;
  past.forEach((value, place) => {
    if (value === null) {
      isDown = false;
      return;
    }
    const x = width - ((past.length - 1 - place) / (SAMPLES - 1)) * width;
    const share = most > least ? (value - least) / (most - least) : 0.5;
    const y = height - 2 - share * (height - 4);
    if (isDown) pen.lineTo(x, y);
    else pen.moveTo(x, y);
    isDown = true;
  });
  pen.stroke();
}
