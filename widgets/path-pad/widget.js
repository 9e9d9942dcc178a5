// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("../../urc/web/static/widgets/path_simplify.js").Point} Point */
import { grasp } from "urc/command_kit";
import { attribute, clamp, drawing, format, number, part, svg, write } from "urc/kit";
import { DIRECTIONS, pointed } from "urc/motion";
import { fitted, lengthOf } from "urc/path_simplify";

/** Distance from the middle to the edge, in units of the drawing, which is 200 wide. */
const EDGE = 96;
const FACE = 200;
/** Maximum number of raw points of a stroke, so that an endless stroke does not fill the memory. */
const MOST_RAW = 2000;
/** Step of an arrow key, as a fraction of the length. */
const STEP = 0.05;
const ARROWS = Object.values(DIRECTIONS).flat();

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    if (!ctx.el.querySelector(".path-pad-field")) return {}; // no command is bound
    const pad = new PathPad(ctx);
    pad.listen();
    return {
      update({ x, y }, { go }) {
        pad.place(x, y);
        pad.notice = go?.notice ?? "";
        pad.reason = go?.reason ?? ctx.t("no command is bound to this pad");
        pad.isAnswered = go?.isAnswered ?? false;
        pad.draw();
      },
    };
  },
};

class PathPad {
  /** @param {Context} ctx */
  constructor(ctx) {
    const { el, options } = ctx;
    this.ctx = ctx;
    this.root = part(el, ".path-pad");
    this.field = part(el, ".path-pad-field");
    this.face = drawing(el, ".path-pad-face");
    this.robot = drawing(el, ".path-pad-robot");
    this.raw = drawing(el, ".path-pad-raw");
    this.line = drawing(el, ".path-pad-line");
    this.dots = drawing(el, ".path-pad-dots");
    this.cursorMark = drawing(el, ".path-pad-cursor");
    this.value = part(el, ".path-pad-value");
    this.note = part(el, ".path-pad-note");
    this.go = part(el, ".path-pad-go");
    this.undo = part(el, ".path-pad-undo");
    this.clear = part(el, ".path-pad-clear");
    this.length = Number(options["length"] ?? 5);
    this.unit = String(options["unit"] ?? "");
    this.tolerance = Number(options["tolerance"] ?? 0.01);
    this.most = Number(options["points"] ?? 100);
    this.reason = ctx.t("not ready yet");
    /** Why the command may have no effect, or "". */
    this.notice = "";
    this.isAnswered = false;
    /** Drawn strokes, as fractions of the length. @type {Point[][]} */
    this.strokes = [];
    /** The stroke under the pointer. @type {Point[]} */
    this.stroke = [];
    /** Points of the confirmed path. @type {Point[]} */
    this.points = [];
    /** @type {[number, number] | null} */
    this.cursor = null;
    /** @type {(right: number, down: number) => Point} */
    this.toPoint = () => [0, 0];
    this.isBusy = false;
    this.outcome = "";
  }

  listen() {
    const { field, ctx } = this;
    const options = { signal: ctx.signal };
    grasp(field, {
      take: (event) => this.down(event),
      move: (event) => this.move(event),
      release: () => this.up(),
      cancel: () => this.cancel(),
      isDrawing: true,
      signal: ctx.signal,
    });
    field.addEventListener("keydown", (event) => this.key(event), options);
    this.go.addEventListener("click", () => void this.send(), options);
    this.undo.addEventListener("click", () => this.keep(this.strokes.slice(0, -1)), options);
    this.clear.addEventListener("click", () => this.keep([]), options);
  }

  /** @param {PointerEvent} event */
  down(event) {
    if (this.isBusy) return false;
    const { left, top, width, height } = this.face.getBoundingClientRect();
    const scale = (Math.min(width, height) * EDGE) / FACE || 1;
    const [middleX, middleY] = [left + width / 2, top + height / 2];
    this.toPoint = (right, down) => [
      clamp((middleY - down) / scale, -1, 1),
      clamp((middleX - right) / scale, -1, 1),
    ];
    this.stroke = [this.toPoint(event.clientX, event.clientY)];
    this.outcome = "";
    this.draw();
    return true;
  }

  /** Also add the moves between two frames, if the browser reports them. @param {PointerEvent} event */
  move(event) {
    const all = event.getCoalescedEvents?.() ?? [];
    for (const one of all.length > 0 ? all : [event]) {
      if (this.stroke.length < MOST_RAW) this.stroke.push(this.toPoint(one.clientX, one.clientY));
    }
    this.draw();
  }

  up() {
    const { stroke } = this;
    this.stroke = [];
    this.keep([...this.strokes, stroke]);
  }

  /** Drop a stroke that was interrupted. */
  cancel() {
    this.stroke = [];
    this.draw();
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey || this.isBusy) return;
    if (ARROWS.includes(event.code)) {
      const { x, y } = pointed(new Set([event.code]));
      const [atX, atY] = this.cursor ?? this.points.at(-1) ?? [0, 0];
      this.cursor = [clamp(atX + x * STEP, -1, 1), clamp(atY + y * STEP, -1, 1)];
      this.draw();
    } else if (event.code === "Enter" && !event.repeat && this.cursor) {
      this.keep([...this.strokes, [this.cursor]]);
    } else if (event.code === "Backspace" || event.code === "Delete") {
      this.keep(this.strokes.slice(0, -1));
    } else {
      return;
    }
    event.preventDefault();
  }

  /** @param {Point[][]} strokes */
  keep(strokes) {
    if (this.isBusy) return;
    this.strokes = strokes;
    this.points = fitted(strokes, this.tolerance, this.most);
    if (strokes.length === 0) this.cursor = null;
    this.outcome = "";
    this.draw();
  }

  /**
   * Return the arguments that the command declares, including lists.
   *
   * @returns {Record<string, any>}
   */
  given() {
    const scaled = this.points.map((point) => point.map((share) => Math.round(share * this.length * 1e4) / 1e4 + 0));
    const all = {
      points: scaled.flat(),
      xs: scaled.map(([x]) => x ?? 0),
      ys: scaled.map(([, y]) => y ?? 0),
    };
    const takes = this.ctx.command("go")?.arguments ?? {};
    return Object.fromEntries(Object.entries(all).filter(([name]) => Object.hasOwn(takes, name)));
  }

  async send() {
    if (this.points.length < 2 || this.isBusy || this.reason) return;
    const { t } = this.ctx;
    this.isBusy = true;
    this.outcome = t("… sending");
    this.draw();
    try {
      await this.ctx.send("go", this.given());
      this.isBusy = false;
      this.keep([]);
      this.outcome = this.isAnswered ? t("✓ done") : t("✓ sent");
    } catch (error) {
      this.outcome = `▲ ${error instanceof Error ? error.message : error}`; // the path stays on the pad
    }
    this.isBusy = false;
    this.draw();
  }

  /**
   * Set the place of the robot; the middle by default.
   *
   * @param {Reading | undefined} x
   * @param {Reading | undefined} y
   */
  place(x, y) {
    const [atX, atY] = [number(x), number(y)];
    const isLost = Boolean(x && y) && (atX === null || atY === null);
    const isOld = [x, y].some((reading) => reading && reading.state !== "live");
    attribute(this.robot, "transform", `translate(${toFace([(atX ?? 0) / this.length, (atY ?? 0) / this.length])})`);
    attribute(this.robot, "data-state", isLost ? "gone" : isOld ? "stale" : "live");
  }

  draw() {
    const { ctx, points, reason, outcome } = this;
    const { t } = ctx;
    const isDrawn = points.length > 0;
    attribute(this.root, "data-phase", reason ? "locked" : this.isBusy ? "busy" : isDrawn ? "drawn" : "idle");
    attribute(this.raw, "points", this.stroke.map(toFace).join(" "));
    attribute(this.line, "points", points.map(toFace).join(" "));
    this.drawDots();
    const [right, down] = toFace(this.cursor ?? [0, 0]).split(",");
    attribute(this.cursorMark, "cx", right ?? "0");
    attribute(this.cursorMark, "cy", down ?? "0");
    attribute(this.cursorMark, "hidden", this.cursor ? null : "");
    const words = { count: points.length, length: format(lengthOf(points) * this.length, 2), unit: this.unit };
    write(this.value, isDrawn ? t("{count} points · {length} {unit}", words) : "—");
    attribute(this.go, "disabled", points.length > 1 && !this.isBusy && !reason ? null : "");
    for (const button of [this.undo, this.clear]) attribute(button, "disabled", isDrawn && !this.isBusy ? null : "");
    const hint = isDrawn ? t("check the path, then send or cancel it") : t("draw a path, or tap its points");
    const why = reason || (outcome ? "" : this.notice);
    write(this.note, why ? `◆ ${why}` : outcome || hint);
  }

  drawDots() {
    const { dots, points } = this;
    while (dots.children.length > points.length) dots.lastElementChild?.remove();
    while (dots.children.length < points.length) dots.append(svg("circle", { r: 3 }));
    points.forEach((point, place) => {
      const [right = "0", down = "0"] = toFace(point).split(",");
      const dot = dots.children[place];
      if (!dot) return;
      attribute(dot, "cx", right);
      attribute(dot, "cy", down);
    });
  }
}

/** @param {readonly [number, number]} point */
function toFace([x, y]) {
  return `${(-y * EDGE + 0).toFixed(1)},${(-x * EDGE + 0).toFixed(1)}`;
}
