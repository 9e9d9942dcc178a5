// @ts-check
/**
 * The context of a widget: its complete interface to the page.
 *
 * @typedef {import("./cell.js").Cell} Cell
 * @typedef {import("../core/types.js").Context} Context
 * @typedef {import("../core/types.js").GateSpec} GateSpec
 * @typedef {import("../core/types.js").Given} Given
 * @typedef {import("../core/types.js").HoldSpec} HoldSpec
 * @typedef {import("../core/types.js").Picture} Picture
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").StopState} StopState
 * @typedef {import("../core/types.js").Topics} Topics
 * @typedef {(bitmap: ImageBitmap, reading: Reading) => void} Shows
 */
import { questionsOf } from "../control/confirm_dialog.js";
import { t } from "./kit.js";
import { memoryOf } from "./tab_storage.js";
import { argumentsOf, describe, goalsOf } from "./output.js";
import { Decoder } from "./image_decoder.js";
import { loadStyle } from "./style.js";

/**
 * @param {Cell} cell
 * @returns {Context}
 */
export function contextOf(cell) {
  const { doors, end } = cell;
  return Object.freeze({
    el: cell.el,
    options: Object.freeze(cell.config.options),
    signal: end.signal,
    on: (/** @type {string} */ input, /** @type {(reading: Reading) => void} */ listener) => {
      cell.listen(input, listener);
    },
    each: (/** @type {string} */ input, /** @type {(reading: Reading, missed: number) => void} */ listener) => {
      each(cell, input, listener);
    },
    send: (/** @type {string} */ output, /** @type {Record<string, Given>} */ args = {}) =>
      give(cell, output, args),
    command: (/** @type {string} */ output) => describe(cell.output(output)),
    steer: (/** @type {string} */ output, /** @type {string} */ verb) => {
      const bound = cell.output(output);
      if (bound !== undefined) doors.steer(bound.command, verb);
    },
    drive: doors.drive,
    memory: memoryOf(cell.config.slot),
    hold: (/** @type {string} */ output, /** @type {HoldSpec} */ spec) => {
      const bound = cell.output(output);
      if (bound === undefined) throw new Error(`the output ${output} is not bound to a command`);
      doors.input.hold(bound, spec, end.signal);
    },
    gate: (/** @type {GateSpec} */ spec) => doors.input.gate(spec, end.signal),
    pads: doors.input.pads,
    stop: () => doors.stop.press(),
    onStop: (/** @type {(state: StopState) => void} */ listener) => {
      doors.stop.follow(cell.guarded(listener), end.signal);
    },
    follow: (/** @type {keyof Topics} */ what, /** @type {(news: any) => void} */ listener) => {
      const tell = cell.guarded(listener);
      const own = what === "goals" ? (/** @type {any} */ news) => tell({ ...news, goals: goalsOf(cell.outputs, news.goals) }) : tell;
      doors.follows.listen(what, own, end.signal);
    },
    alarms: Object.freeze({
      may: () => doors.alarms.mayAct,
      acknowledge: (/** @type {readonly import("../core/types.js").Alert[]} */ alerts) => void doors.alarms.acknowledge(alerts),
      shelve: (/** @type {import("../core/types.js").Alert} */ { signal }, /** @type {number} */ minutes) =>
        doors.alarms.shelve([signal], minutes),
      open: () => doors.alarms.open(),
    }),
    picture: (/** @type {string} */ input, /** @type {Shows} */ show, /** @type {((blob: Blob) => void) | undefined} */ failed) => {
      picture(cell, input, show, failed);
    },
    shown: (/** @type {import("../control/shown_images.js").Numbered} */ image) => doors.input.images.show(image, performance.now()),
    look: (/** @type {string} */ input, /** @type {readonly number[]} */ places) => cell.look(input, places),
    t,
    unit: (/** @type {string} */ input) => unit(cell, input),
    style: loadStyle,
  });
}

/**
 * Run the command of an output, after the confirmations that the driver requires.
 *
 * @param {Pick<Cell, "doors" | "el" | "end" | "output" | "isForeign">} cell
 * @param {string} output
 * @param {Record<string, Given>} given arguments by the names of the widget's manifest
 */
export async function give(cell, output, given) {
  const bound = cell.output(output);
  if (bound === undefined) throw new Error(`the output ${output} is not bound to a command`);
  const { command } = bound;
  const args = argumentsOf(bound, given);
  const questions = questionsOf(bound.asks ?? [], args);
  if (questions.length === 0) {
    // Third-party code cannot prove a user's action, so the operator must confirm before anything
    // moves.
    if (cell.isForeign && bound.mayMove) await agreed(cell, bound.title || command);
    return cell.doors.run(command, args);
  }
  const ticket = await cell.doors.asks.ask(cell.el, questions, cell.end.signal);
  try {
    return await cell.doors.run(command, args, ticket);
  } finally {
    ticket.close();
  }
}

/**
 * Ask whether a third-party widget may run a command that moves the robot; reject if the answer is
 * no.
 *
 * @param {Pick<Cell, "doors" | "el" | "end">} cell
 * @param {string} title title of the command
 */
async function agreed(cell, title) {
  const text = t("This widget wants to run “{command}”. The robot may move.", { command: title });
  /** @type {import("../core/types.js").Question} */
  const question = { argument: "", value: "", text, level: "normal", isTwoPerson: false };
  const ticket = await cell.doors.asks.ask(cell.el, [question], cell.end.signal);
  ticket.close();
}

/**
 * @param {Cell} cell
 * @param {string} input
 * @param {(reading: Reading, missed: number) => void} listener
 */
function each(cell, input, listener) {
  const { store } = cell.doors;
  const bound = cell.inputs.find((one) => one.input === input);
  bound?.signals.forEach((name, place) => {
    const hear = (/** @type {number} */ missed) => {
      // With the state at the time of measurement, because a late reading still counts.
      const reading = cell.reading(bound, place, store, store.samples.get(name)?.timeMs ?? 0);
      cell.measured(performance.now(), () => listener(reading, missed));
    };
    if (store.samples.has(name)) hear(0);
    store.each.listen(name, hear, cell.end.signal);
  });
}

/**
 * @param {Cell} cell
 * @param {string} input
 * @param {Shows} show
 * @param {(blob: Blob) => void} [failed]
 */
function picture(cell, input, show, failed) {
  /** @type {Reading | null} */
  let newest = null;
  const draw = cell.guarded((/** @type {{bitmap: ImageBitmap, image: Picture}} */ { bitmap, image }) => {
    if (!newest) return;
    show(bitmap, newest);
    cell.doors.input.images.show(image, performance.now());
  });
  const fail = cell.guarded((/** @type {Blob} */ blob) => failed?.(blob));
  const decoder = new Decoder((bitmap, image) => draw({ bitmap, image }), (error, { blob }) => {
    console.info(`widget ${cell.config.widget}: an image could not be decoded:`, error);
    fail(blob);
  });
  cell.end.signal.addEventListener("abort", () => decoder.end());
  const take = (/** @type {Reading} */ reading) => {
    newest = reading;
    if (reading.image) decoder.take(reading.image);
  };
  cell.listen(input, take);
}

/**
 * @param {Cell} cell
 * @param {string} input
 */
function unit(cell, input) {
  const { edition } = cell.doors.store;
  const known = cell.shownIn.get(input);
  if (known?.edition === edition) return known;
  const made = { edition, ...unitOf(cell, input) };
  cell.shownIn.set(input, made);
  return made;
}

/**
 * @param {Cell} cell
 * @param {string} input
 */
function unitOf(cell, input) {
  const bound = cell.inputs.find((each) => each.input === input);
  const { store } = cell.doors;
  const reading = bound ? cell.reading(bound, 0, store, 0) : null;
  const shown = store.units.shown(reading?.signal.unit ?? "");
  return {
    symbol: shown.symbol,
    factor: (/** @type {number} */ value) => value * shown.factor + shown.offset,
  };
}
