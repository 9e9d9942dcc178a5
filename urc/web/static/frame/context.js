// @ts-check
/**
 * The context of a widget in a frame: the same interface as in the page, through the frame's port.
 *
 * @typedef {import("./frame.js").Frame} Frame
 * @typedef {import("../core/types.js").Context} Context
 * @typedef {import("../core/types.js").GateSpec} GateSpec
 * @typedef {import("../core/types.js").Given} Given
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").StopState} StopState
 * @typedef {import("../core/types.js").Topics} Topics
 * @typedef {(bitmap: ImageBitmap, reading: Reading) => void} Shows
 */
import { t } from "../widgets/kit.js";
import { Decoder } from "../widgets/image_decoder.js";
import { loadStyle } from "../widgets/style.js";

const MOST_KEPT = 20_000;
/**
 * Topics for frames. The log and the alarm statistics are missing, because they concern the whole
 * robot.
 */
const TOLD = ["links", "lease", "alarms", "latency", "sequences", "theme"];
/** Requests about the controls that a third-party widget may send. */
const WISHES = ["take", "ask", "leave"];

/**
 * @param {Frame} frame
 * @param {Readonly<Record<string, unknown>>} options
 * @returns {Context}
 */
export function contextOf(frame, options) {
  let lastId = 0;
  let areViewsAsked = false;
  return Object.freeze({
    el: frame.el,
    options,
    signal: frame.end.signal,
    on: (/** @type {string} */ input, /** @type {(reading: Reading) => void} */ listener) => {
      frame.listeners.set(input, [...(frame.listeners.get(input) ?? []), listener]);
    },
    each: () => {
      throw new Error(t("a widget in a frame cannot use {wish}", { wish: "each" }));
    },
    send: async (/** @type {string} */ output, /** @type {Record<string, Given>} */ args = {}) => {
      bound(frame, output);
      lastId += 1;
      const id = lastId;
      frame.say({ t: "send", id, output, args });
      return new Promise((resolve, reject) => frame.waiting.set(id, { resolve, reject }));
    },
    command: (/** @type {string} */ output) =>
      Object.hasOwn(frame.commands, output) ? (frame.commands[output] ?? null) : null,
    steer: (/** @type {string} */ output, /** @type {string} */ verb) => frame.say({ t: "steer", output, verb }),
    drive: (/** @type {string} */ wish) => {
      if (!WISHES.includes(wish)) throw new Error(t("a widget in a frame cannot use {wish}", { wish }));
      frame.say({ t: "drive", wish });
    },
    memory: memoryOf(frame),
    hold: (/** @type {string} */ output, /** @type {HoldSpec} */ spec) => {
      bound(frame, output);
      frame.grips.hold(output, spec);
    },
    gate: (/** @type {GateSpec} */ spec) => frame.grips.gate(spec),
    pads: {
      views: () => {
        if (!areViewsAsked) frame.say({ t: "pads" });
        areViewsAsked = true;
        return frame.pads;
      },
      setMap: () => {
        throw new Error(t("a widget in a frame cannot use {wish}", { wish: "setMap" }));
      },
    },
    stop: () => frame.say({ t: "stop" }),
    onStop: (/** @type {(state: StopState) => void} */ listener) => frame.follow("stop", listener),
    follow: (/** @type {keyof Topics} */ what, /** @type {(news: any) => void} */ listener) => {
      if (!TOLD.includes(what)) {
        throw new Error(`there is no ${what} to follow in a frame, only ${TOLD.join(", ")}`);
      }
      frame.follow(what, listener);
    },
    alarms: Object.freeze({ may: () => false, acknowledge: refused, shelve: refused, open: refused }),
    picture: (/** @type {string} */ input, /** @type {Shows} */ show, /** @type {((blob: Blob) => void) | undefined} */ failed) => {
      picture(frame, input, show, failed);
    },
    // The page cannot verify what a third-party widget draws, so its images do not permit motion.
    shown: () => {},
    look: (/** @type {string} */ input, /** @type {readonly number[]} */ places) => frame.say({ t: "look", input, places }),
    t,
    unit: (/** @type {string} */ input) => unit(frame, input),
    style: loadStyle,
  });
}

function refused() {
  throw new Error(t("a widget in a frame cannot use {wish}", { wish: "alarms" }));
}

/**
 * @param {Frame} frame
 * @param {string} output
 */
function bound(frame, output) {
  if (!Object.hasOwn(frame.commands, output)) {
    throw new Error(`the output ${output} is not bound to a command`);
  }
}

/** @param {Frame} frame */
function memoryOf(frame) {
  return {
    read: () => frame.memory,
    write: (/** @type {unknown} */ value) => {
      const text = JSON.stringify(value) ?? "null";
      if (text.length > MOST_KEPT) throw new Error("a widget keeps too much");
      frame.memory = JSON.parse(text);
      frame.say({ t: "memory", text });
    },
  };
}

/**
 * @param {Frame} frame
 * @param {string} input
 * @param {Shows} show
 * @param {(blob: Blob) => void} [failed]
 */
function picture(frame, input, show, failed) {
  /** @type {Reading | null} */
  let newest = null;
  const draw = frame.guarded((/** @type {ImageBitmap} */ bitmap) => {
    if (newest) show(bitmap, newest);
  });
  const fail = frame.guarded((/** @type {Blob} */ blob) => failed?.(blob));
  const decoder = new Decoder(draw, (error, { blob }) => {
    console.info(`widget ${frame.widget}: an image could not be decoded:`, error);
    fail(blob);
  });
  frame.end.signal.addEventListener("abort", () => decoder.end());
  const take = (/** @type {Reading} */ reading) => {
    newest = reading;
    if (reading.image) decoder.take(reading.image);
  };
  frame.listeners.set(input, [...(frame.listeners.get(input) ?? []), take]);
}

/**
 * @param {Frame} frame
 * @param {string} input
 */
function unit(frame, input) {
  const { factor, offset, symbol } = frame.units[input] ?? { factor: 1, offset: 0, symbol: "" };
  return { symbol, factor: (/** @type {number} */ value) => value * factor + offset };
}
