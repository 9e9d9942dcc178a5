// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./field.js").Field} Field */
/** @typedef {import("./field.js").Form} Form */
import { grasp } from "urc/command_kit";
import { DASH, attribute, clamp, colours, format, noteOf, part, style, write } from "urc/kit";
import { palette, pixel } from "urc/colour_map";
import { Sheet } from "urc/offscreen_canvas";
import { arrayField, paint, pixelAt, probe, readField } from "./field.js";

const STEP = 0.02;

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const depth = new Depth(ctx);
    ctx.follow("theme", () => depth.paint());
    return {
      update: ({ image }, { probe: outlet }) => depth.update(image, outlet),
      resize: () => depth.mark(),
      destroy: () => depth.end(),
    };
  },
};

class Depth {
  /** @param {Context} ctx */
  constructor({ el, options, t, send, signal }) {
    this.t = t;
    this.send = send;
    this.options = options;
    this.root = part(el, ".depth");
    this.face = part(el, ".depth-face");
    this.cross = part(el, ".depth-cross");
    this.text = part(el, ".depth-text");
    this.note = part(el, ".depth-note");
    const [data, bar] = el.querySelectorAll("canvas");
    if (!data || !bar) throw new Error("the template has no canvas");
    this.sheet = new Sheet(data);
    this.clip = { near: Number(options["near"] ?? 0.3), far: Number(options["far"] ?? 5) };
    this.palette = palette(options["palette"] === "grey" ? "grey" : "cividis");
    /** Point of the measurement, as fractions of the image. */
    this.point = { x: 0.5, y: 0.5 };
    /** @type {Field | null} */
    this.field = null;
    /** @type {Reading | null} */
    this.reading = null;
    /** Newest reading that arrived during decoding. @type {Reading | null} */
    this.next = null;
    this.isBusy = false;
    this.isOver = false;
    this.serial = -1;
    this.fault = "";
    this.outcome = "";
    this.canSend = false;
    this.legend(bar);
    this.listen(signal);
  }

  /** @param {HTMLCanvasElement} bar */
  legend(bar) {
    const sheet = new Sheet(bar);
    const image = new ImageData(256, 1);
    new Uint32Array(image.data.buffer).set(this.palette.toReversed());
    sheet.resize(256, 1);
    sheet.pen.putImageData(image, 0, 0);
    sheet.show();
    write(part(this.root, ".depth-near"), `≤ ${format(this.clip.near)} m`);
    write(part(this.root, ".depth-far"), `≥ ${format(this.clip.far)} m`);
  }

  /** @param {AbortSignal} signal */
  listen(signal) {
    const point = (/** @type {PointerEvent} */ event) => {
      const box = this.box();
      this.move((event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
    };
    grasp(this.face, {
      take(event) {
        point(event);
        return true;
      },
      move: point,
      release: () => void this.give(),
      cancel() {},
      signal,
    });
    this.face.addEventListener("keydown", (event) => this.key(event), { signal });
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    const way = Object.hasOwn(ways, event.key) ? Reflect.get(ways, event.key) : undefined;
    if (event.key === "Enter" && !event.repeat) this.give();
    if (!way) return;
    event.preventDefault();
    this.move(this.point.x + STEP * way[0], this.point.y + STEP * way[1]);
  }

  /** Return the rectangle of the image on the page, with its own aspect ratio, within or beyond the canvas. */
  box() {
    const { left, top, width, height } = this.face.getBoundingClientRect();
    const { width: columns, height: rows } = this.sheet.canvas;
    const [across, down] = [width / columns, height / rows];
    const scale = this.options["fit"] === "cover" ? Math.max(across, down) : Math.min(across, down);
    const [wide, high] = [columns * scale || 1, rows * scale || 1];
    return { left: left + (width - wide) / 2, top: top + (height - high) / 2, width: wide, height: high };
  }

  /**
   * @param {number} x
   * @param {number} y
   */
  move(x, y) {
    this.point = { x: clamp(x, 0, 1), y: clamp(y, 0, 1) };
    this.mark();
    this.show();
  }

  mark() {
    const [box, face] = [this.box(), this.face.getBoundingClientRect()];
    style(this.cross, "left", `${(box.left - face.left + this.point.x * box.width).toFixed(1)}px`);
    style(this.cross, "top", `${(box.top - face.top + this.point.y * box.height).toFixed(1)}px`);
  }

  /**
   * @param {Reading | undefined} reading
   * @param {Outlet | undefined} outlet
   */
  update(reading, outlet) {
    this.canSend = outlet?.isReady ?? false;
    if (!reading) return;
    this.reading = reading;
    attribute(this.root, "data-state", reading.state);
    const serial = reading.image?.serial ?? reading.serial;
    if (serial !== this.serial && reading.value !== null) {
      this.serial = serial;
      this.next = reading;
      if (!this.isBusy) void this.work();
    }
    this.show();
  }

  async work() {
    this.isBusy = true;
    while (this.next && !this.isOver) {
      const reading = this.next;
      this.next = null;
      try {
        this.field = await this.read(reading);
        this.fault = "";
      } catch (error) {
        this.field = null;
        this.fault = error instanceof Error ? error.message : String(error);
      }
      if (!this.isOver) this.paint();
    }
    this.isBusy = false;
  }

  /**
   * @param {Reading} reading
   * @returns {Promise<Field | null>}
   */
  async read({ image, value }) {
    const form = this.form();
    if (Array.isArray(value)) return arrayField(value, { ...form, scale: this.scale(1) });
    return image ? readField(new Uint8Array(await image.blob.arrayBuffer()), form) : null;
  }

  /** @returns {Form} */
  form() {
    const encoding = this.options["encoding"];
    const isFloat = encoding === "32FC1";
    return {
      encoding: isFloat ? "32FC1" : encoding === "8UC1" ? "8UC1" : "16UC1",
      width: Number(this.options["width"] ?? 0),
      height: Number(this.options["height"] ?? 0),
      bigEndian: this.options["big_endian"] === true,
      scale: this.scale(isFloat ? 1 : 0.001),
    };
  }

  /** @param {number} otherwise */
  scale(otherwise) {
    const given = this.options["scale"];
    return typeof given === "number" ? given : otherwise;
  }

  paint() {
    const { field, sheet } = this;
    if (field) {
      const { canvas } = sheet;
      const isNew = canvas.width !== field.width || canvas.height !== field.height;
      sheet.resize(field.width, field.height);
      const image = new ImageData(field.width, field.height);
      // Unknown pixels have the colour of the background, which is not part of the scale.
      const { surface } = colours(this.root, ["surface"]);
      paint(field, this.clip, this.palette, pixel(surface), new Uint32Array(image.data.buffer));
      sheet.pen.putImageData(image, 0, 0);
      sheet.show();
      if (isNew) this.mark();
    }
    this.show();
  }

  show() {
    const { field, reading, fault } = this;
    const isShown = reading !== null && reading.value !== null && !fault;
    const distance = field && isShown ? probe(field, this.point.x, this.point.y) : NaN;
    const [column, row] = field ? pixelAt(field, this.point.x, this.point.y) : [0, 0];
    const known = Number.isNaN(distance) ? DASH : `${format(distance, distance < 10 ? 2 : 1)} m`;
    write(this.text, field && isShown ? `${known} · ${column}, ${row}` : DASH);
    attribute(this.root, "data-fault", fault ? "yes" : null);
    const note = reading ? noteOf(reading, this.t) : this.t("no value yet");
    write(this.note, [fault ? `▲ ${fault}` : "", this.outcome, note].filter(Boolean).join(" · "));
  }

  async give() {
    const { field } = this;
    if (!field || !this.canSend) return;
    const [x, y] = pixelAt(field, this.point.x, this.point.y);
    const metres = probe(field, this.point.x, this.point.y);
    if (Number.isNaN(metres)) return;
    try {
      await this.send("probe", { x, y, distance: Math.round(metres * 1000) / 1000 });
      this.outcome = `✓ ${this.t("sent")}`;
    } catch (error) {
      this.outcome = `▲ ${error instanceof Error ? error.message : error}`;
    }
    this.show();
  }

  end() {
    this.isOver = true;
    this.next = null;
  }
}
