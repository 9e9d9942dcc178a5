// @ts-check
/** @typedef {import("../../urc/web/static/core/types.js").Context} Context */
/** @typedef {import("../../urc/web/static/core/types.js").HoldState} HoldState */
/** @typedef {import("../../urc/web/static/core/types.js").Instance} Instance */
/** @typedef {import("../../urc/web/static/core/types.js").Outlet} Outlet */
/** @typedef {import("../../urc/web/static/core/types.js").Reading} Reading */
/** @typedef {import("./frame.js").Fit} Fit */
import { DASH, attribute, button, faultOf, many, noteOf, part, write } from "urc/kit";
import { Rate, ageText, fileName, lookOf, place } from "./frame.js";
import { Newest } from "./newest.js";
import { Screen } from "./screen.js";

/** Whether the screen has room for signs only, such as a phone in landscape. */
const isLow = () => matchMedia("(height < 30rem)").matches;
const isUprightPhone = () => matchMedia("(width < 37.5rem)").matches;
const LOOK_AGAIN_MS = 200;
const FULL_COLOUR_MS = 5000;
const KEYS = ["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight"];
const KEY_LEVEL = 0.5;
/** Key under which the device stores whether the background shows the image whole. */
const KEPT_FIT = "urc-picture-fit";

export default {
  /**
   * @param {Context} ctx
   * @returns {Instance}
   */
  mount(ctx) {
    const camera = new Camera(ctx);
    return {
      update: (readings, { look }) => camera.update(readings, look),
      resize: () => camera.draw(),
      destroy: () => camera.end(),
    };
  },
};

class Camera {
  /** @param {Context} ctx */
  constructor(ctx) {
    const { el, options, t } = ctx;
    this.ctx = ctx;
    this.t = t;
    this.signal = ctx.signal;
    this.root = part(el, ".camera");
    this.face = part(el, ".camera-face");
    this.age = part(el, ".camera-age");
    this.note = part(el, ".camera-note");
    this.tools = part(el, ".camera-tools");
    /** The buttons that move to the bar while the camera is the background. */
    this.more = part(el, ".camera-more");
    this.title = part(el, ".camera-title").textContent ?? "";
    const canvas = el.querySelector("canvas");
    if (!canvas) throw new Error("the template has no canvas");
    this.canvas = canvas;
    this.cross = el.querySelector(".camera-cross");
    this.screen = new Screen(canvas);
    this.look = {
      fit: /** @type {Fit | "auto"} */ (options["fit"] ?? "auto"),
      rotate: Number(options["rotate"] ?? 0),
      mirror: options["mirror"] === true,
    };
    this.freeze = Number(options["freeze"] ?? 1);
    this.rate = options["rate"] === true ? new Rate() : null;
    /** @type {Reading[]} */
    this.sources = [];
    /** Number of images in the input `images`. */
    this.listed = 0;
    this.chosen = 0;
    /** @type {HTMLButtonElement[] | undefined} */
    this.switches = undefined;
    this.fault = "";
    /** Note for the operator who turns the camera. */
    this.hand = "";
    this.pictures = new Newest(
      (bitmap, picture) => {
        this.fault = "";
        this.rate?.add(performance.now() / 1000);
        if (this.screen.show(bitmap)) this.draw();
        ctx.shown(picture);
        if (this.shutter) this.shutter.disabled = false;
        this.tell();
      },
      (blob) => {
        this.fault = faultOf(blob, t);
        this.tell();
      },
    );
    this.isWhole = false;
    this.face.addEventListener("dblclick", () => {
      this.isWhole = !this.isWhole;
      this.draw();
    }, { signal: this.signal });
    this.addFit();
    if (options["snapshot"] !== false) this.addSnapshot();
    this.addFullColour();
    if (this.face.tabIndex === 0) this.addHold(ctx);
    // A timer, because the age also grows without new images.
    this.timer = setInterval(() => this.tellAge(), LOOK_AGAIN_MS);
  }

  /**
   * @param {string} sign
   * @param {string} name
   * @param {() => void} press
   * @param {HTMLElement} [group]
   */
  addButton(sign, name, press, group = this.more) {
    const made = button("camera-button urc-view-button", sign, press, { signal: this.signal, label: name });
    group.append(made);
    return made;
  }

  addSnapshot() {
    this.shutter = this.addButton(isLow() ? "⤓" : `⤓ ${this.t("Save")}`, this.t("Save picture"), () => void this.keep());
    this.shutter.disabled = true;
  }

  /** Add the button that shows dimmed images in full colour for a moment. */
  addFullColour() {
    /** @type {number | undefined} */
    let ending;
    const show = () => {
      clearTimeout(ending);
      attribute(this.root, "data-full", "yes");
      ending = window.setTimeout(() => attribute(this.root, "data-full", null), FULL_COLOUR_MS);
    };
    this.addButton("☀", this.t("Full colour for 5 s"), show).classList.add("urc-view-full");
    this.signal.addEventListener("abort", () => clearTimeout(ending));
  }

  /** @param {Context} ctx */
  addHold({ hold, t }) {
    hold("look", {
      el: this.face,
      keys: KEYS,
      sample: (hand) => {
        if (hand.kind === "pointer") return lookOf(hand, this.face.getBoundingClientRect());
        const is = (/** @type {string} */ code) => Number(hand.keys.has(code));
        return {
          pan: KEY_LEVEL * (is("ArrowLeft") - is("ArrowRight")),
          tilt: KEY_LEVEL * (is("ArrowUp") - is("ArrowDown")),
        };
      },
      show: (/** @type {HoldState} */ { phase, reason }) => {
        attribute(this.root, "data-phase", phase);
        const why = phase !== "idle" && reason ? `◆ ${reason}` : "";
        this.hand = phase === "asking" ? `… ${t("taking control")}` : why;
        this.tell();
      },
    });
  }

  /**
   * @param {Readonly<Record<string, Reading>>} readings
   * @param {Outlet | undefined} look
   */
  update(readings, look) {
    const one = readings["image"];
    const more = many(readings["images"]);
    this.listed = more.length;
    this.sources = [...(one ? [one] : []), ...more];
    if (this.sources.length > 1) this.showSwitches();
    const reading = this.sources[this.chosen];
    attribute(this.root, "data-state", reading?.state ?? "none");
    attribute(this.root, "data-locked", look?.reason ? "yes" : null);
    this.locked = look?.reason ?? "";
    this.take(reading);
    if (this.shutter) this.shutter.disabled = !this.pictures.shown || !reading || reading.value === null;
    this.tell();
  }

  /** @param {Reading | undefined} reading */
  take(reading) {
    const picture = reading?.image ?? reading?.video;
    if (picture && reading?.value !== null) this.pictures.take(picture);
  }

  /** Show a button for each camera. Titles arrive with the signals, sometimes after the first reading. */
  showSwitches() {
    const isFirst = !this.switches;
    this.switches ??= this.sources.map((_, index) => {
      const made = this.addButton("", "", () => this.choose(index), this.tools);
      attribute(made, "aria-pressed", String(index === this.chosen));
      return made;
    });
    this.switches.forEach((one, place) => {
      const signal = this.sources[place]?.signal;
      write(one, signal?.title || signal?.name || "");
    });
    if (isFirst) this.lookAtChosen();
  }

  /** Request the images of the chosen camera only. */
  lookAtChosen() {
    const singles = this.sources.length - this.listed;
    this.ctx.look("image", this.chosen < singles ? [0] : []);
    this.ctx.look("images", this.chosen < singles ? [] : [this.chosen - singles]);
  }

  /** @param {number} index */
  choose(index) {
    if (index === this.chosen) return;
    this.chosen = index;
    this.pictures.leave();
    this.screen.clear();
    this.lookAtChosen();
    this.fault = "";
    this.switches?.forEach((button, place) => attribute(button, "aria-pressed", String(place === index)));
    this.draw();
    const reading = this.sources[index];
    attribute(this.root, "data-state", reading?.state ?? "none");
    this.take(reading);
    this.tell();
  }

  /** @returns {Fit} */
  fit() {
    const { fit } = this.look;
    if (!this.isGround()) return fit === "auto" ? "contain" : fit;
    if (this.isWhole) return "contain";
    if (fit !== "auto" && !this.choice) return fit;
    // On a phone in portrait, the widgets are below the picture, which takes the whole width.
    if (isUprightPhone()) return this.choice === "fit" ? "contain" : "cover";
    return this.choice === "fill" ? "filled" : "ground";
  }

  /** Add the switch that lets the background show the image whole, or fill the page with it. */
  addFit() {
    this.choice = keptChoice();
    this.fitter = this.addButton("", "", () => {
      const choice = this.isFilled() ? "fit" : "fill";
      this.choice = choice;
      this.isWhole = false;
      keepChoice(choice);
      this.draw();
    });
    this.tellFit();
  }

  isFilled() {
    const fit = this.fit();
    return fit !== "ground" && fit !== "contain";
  }

  /** Name what a press of the switch does; in a cell, there is no switch. */
  tellFit() {
    if (!this.fitter) return;
    const isFilled = this.isFilled();
    this.fitter.hidden = !this.isGround();
    write(this.fitter, isFilled ? this.t("Fit") : this.t("Fill"));
    const name = isFilled ? this.t("Fit the whole picture") : this.t("Fill the page with the picture");
    attribute(this.fitter, "aria-label", name);
    attribute(this.fitter, "title", name);
  }

  isGround() {
    return this.root.closest('[data-place="ground"]') !== null;
  }

  /** Place the image in its box. The browser scales the image, so that no frame must be redrawn. */
  draw() {
    this.tellFit();
    const size = { width: this.face.clientWidth, height: this.face.clientHeight };
    const { shown } = this.pictures;
    if (!shown || size.width === 0 || size.height === 0) return;
    const { x, y, width, height, angle, flip } = place(shown, size, { ...this.look, fit: this.fit() });
    const { style } = this.canvas;
    style.width = `${width}px`;
    style.height = `${height}px`;
    style.transform = `translate(${x}px, ${y}px) scaleX(${flip}) rotate(${angle}rad) translate(-50%, -50%)`;
    const isLying = angle % Math.PI !== 0;
    const [wide, high] = isLying ? [height, width] : [width, height];
    const inset = (/** @type {number} */ free) => `${Math.max(0, free / 2)}px`;
    this.root.style.setProperty("--urc-picture-inset", `${inset(size.height - high)} ${inset(size.width - wide)}`);
    // The crosshair marks the middle of the image.
    if (this.cross instanceof SVGElement) this.cross.style.transform = `translateY(${y - size.height / 2}px)`;
  }

  tell() {
    const reading = this.sources[this.chosen];
    this.tellAge();
    if (!reading) {
      write(this.note, `◆ ${this.t("no camera is bound here")}`);
      return;
    }
    const known = reading.state === "none" ? this.t("no picture yet") : reading.state === "gone" ? noteOf(reading, this.t) : "";
    const locked = this.face.tabIndex === 0 && this.locked && !this.hand ? `◆ ${this.locked}` : "";
    write(this.note, [this.fault, this.hand, locked, known].filter(Boolean).join(" · "));
  }

  tellAge() {
    const reading = this.sources[this.chosen];
    const isShown = reading !== undefined && reading.value !== null;
    const nowS = performance.now() / 1000;
    const ageS = isShown ? nowS - reading.time : 0;
    const isRepeated = isShown && (reading.image?.isRepeated === true || reading.video?.firstNumber !== undefined);
    const isFrozen = isRepeated || (isShown && ageS >= this.freeze);
    attribute(this.root, "data-frozen", isFrozen ? "yes" : null);
    const quality = isShown ? reading.video?.quality : undefined;
    attribute(this.root, "data-quality", quality?.isSparse ? "keyframes" : quality?.isLow ? "low" : null);
    const rate = this.rate && !isFrozen ? `${this.rate.perSecond(nowS).toFixed(0)} /s` : "";
    const words = isRepeated ? this.t("Camera repeats the same image") : this.t("{age} old", { age: ageText(ageS) });
    const old = isFrozen ? `❄ ${words}` : rate;
    write(this.age, isShown ? [...this.qualityWords(quality), old].filter(Boolean).join(" · ") : DASH);
  }

  /**
   * Return what a slow line leaves out of a video.
   *
   * @param {import("../../urc/web/static/live/videos.js").Quality | undefined} quality
   */
  qualityWords(quality) {
    const words = quality?.isLow ? [this.t("Low stream")] : [];
    if (quality?.isSparse) {
      const count = quality.of;
      words.push(count > 1 ? this.t("1 of {count} images", { count }) : this.t("Keyframes only"));
    }
    return words.map((text) => `▽ ${text}`);
  }

  async keep() {
    const { shown } = this.pictures;
    if (!shown) return;
    const bitmap = await createImageBitmap(shown.blob ?? this.canvas);
    const { rotate, mirror } = this.look;
    const isLying = (rotate / 90) % 2 === 1;
    const canvas = document.createElement("canvas");
    [canvas.width, canvas.height] = isLying ? [bitmap.height, bitmap.width] : [bitmap.width, bitmap.height];
    const pen = canvas.getContext("2d");
    const lie = place(bitmap, canvas, { fit: "contain", rotate, mirror });
    pen?.translate(lie.x, lie.y);
    pen?.scale(lie.flip, 1);
    pen?.rotate(lie.angle);
    pen?.drawImage(bitmap, -lie.width / 2, -lie.height / 2, lie.width, lie.height);
    bitmap.close();
    const blob = await new Promise((/** @type {BlobCallback} */ done) => canvas.toBlob(done, "image/png"));
    if (!blob || this.signal.aborted) return;
    const link = document.createElement("a");
    const url = URL.createObjectURL(blob);
    link.href = url;
    link.download = fileName(this.title, new Date());
    link.click();
    // The browser reads the URL after the click.
    setTimeout(() => URL.revokeObjectURL(url), 10_000);
  }

  end() {
    clearInterval(this.timer);
    this.pictures.end();
  }
}

/** @returns {"fit" | "fill" | null} null before a choice on this device */
function keptChoice() {
  try {
    const kept = localStorage.getItem(KEPT_FIT);
    return kept === "fit" || kept === "fill" ? kept : null;
  } catch {
    return null;
  }
}

/** @param {"fit" | "fill"} choice */
function keepChoice(choice) {
  try {
    localStorage.setItem(KEPT_FIT, choice);
  } catch {
    // In private mode, the choice lasts until the page closes.
  }
}
