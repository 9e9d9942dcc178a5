// @ts-check
/**
 * The latest value of every signal, and its age. The module uses no DOM and no socket.
 *
 * Ages are counted on the page's own clock, from the time of the measurement. The server sends the
 * age at the time of sending. A message's extra delay is computed relative to the fastest message
 * so far, so a value that waited in a full buffer gets its true age.
 *
 * @typedef {import("../core/types.js").Alarm} Alarm
 * @typedef {import("../core/types.js").Conversion} Conversion
 * @typedef {import("../core/types.js").Held} Held
 * @typedef {import("../core/types.js").Hello} Hello
 * @typedef {import("../core/types.js").Link} Link
 * @typedef {import("../core/types.js").Picture} Picture
 * @typedef {import("../core/types.js").Reading} Reading
 * @typedef {import("../core/types.js").Signal} Signal
 * @typedef {import("../core/types.js").State} State
 * @typedef {import("../core/types.js").Values} Values
 *
 * @typedef {import("../core/types.js").VideoImage} VideoImage
 *
 * @typedef {{value: Held, alarm: Alarm, timeMs: number, serial: number, image?: Picture, video?: VideoImage}} Sample
 */
import { priorityOf } from "../core/alarm_signs.js";
import { SampleHistory } from "./sample_history.js";
import { digitsIn } from "../core/number_format.js";
import { ageText, textOf } from "../core/formatting.js";
import { converted, factorOf, Units } from "../core/units.js";
import { t } from "../core/words.js";
import { TopicNotes } from "./topic_notes.js";

export { ageText, DASH } from "../core/formatting.js";

/**
 * Multiple of the largest age after which a value is no longer shown. While its link is lost, the
 * last value stays in sight with its age, because it is all that is known about the robot.
 */
const GONE_AFTER = 10;
/**
 * Age up to which an equal value is not redrawn, because the page draws all ages at this interval
 * anyway.
 */
const STEADY_MS = 250;
/** Maximum drift between two good clocks. */
const DRIFT = 1e-4;
const SHORT_TRIP_MS = 250;
const LONG_LAG_MS = 1000;
/** Stand-in for an undeclared signal. @type {Signal} */
const UNKNOWN = { name: "", type: "string" };
/** Types of signals that may hold images. */
export const PICTURES = new Set(["image", "blob", "occupancy_grid", "point_cloud", "video"]);

export class Store {
  constructor() {
    /** @type {Map<string, Signal>} */
    this.signals = new Map();
    /** @type {string[]} */
    this.names = [];
    /** @type {Map<string, Sample>} */
    this.samples = new Map();
    /** @type {Map<string, Link>} */
    this.links = new Map();
    /** Time of the loss of each lost link. @type {Map<string, number>} */
    this.downMs = new Map();
    /** Whether any link has been connected since the page was opened. */
    this.wasLive = false;
    this.isUp = false;
    /** Whether every link is connected, as a shortcut for checking each link. */
    this.isAllUp = false;
    /** Time of the loss of the connection to URC. */
    this.lostMs = 0;
    this.serial = 0;
    /** Increases with each new declaration of signals by the server. */
    this.edition = 0;
    /** Whether any signal is an image, as a shortcut for the search in each frame. */
    this.hasPictures = false;
    this.skewMs = Infinity;
    this.skewSetMs = 0;
    this.topics = new TopicNotes();
    this.each = new SampleHistory();
    this.units = new Units();
    /** Signals in the units of inputs. @type {WeakMap<Conversion, Signal>} */
    this.wanted = new WeakMap();
  }

  /**
   * Apply the server's declarations. Values stay with their ages. Values of removed signals are
   * deleted, because they would never become stale.
   *
   * @param {Hello} hello
   * @param {number} nowMs
   */
  hello(hello, nowMs) {
    this.signals = new Map(hello.signals.map((signal) => [signal.name, signal]));
    this.names = hello.signals.map((signal) => signal.name);
    for (const name of this.samples.keys()) {
      if (!this.signals.has(name)) this.samples.delete(name);
    }
    this.hasPictures = hello.signals.some(({ type }) => PICTURES.has(type));
    this.topics.take([]);
    this.edition += 1;
    this.links = new Map();
    this.downMs = new Map();
    this.skewMs = Infinity;
    this.lagMs(hello.now, nowMs);
    this.countLinks();
  }

  /**
   * @param {boolean} isUp
   * @param {number} nowMs
   */
  setUp(isUp, nowMs) {
    if (this.isUp && !isUp) this.lostMs = nowMs;
    this.isUp = isUp;
    if (!isUp) this.links = new Map();
    this.countLinks();
  }

  countLinks() {
    this.isAllUp = this.isUp && [...this.links.values()].every(({ state }) => isConnected(state));
  }

  /**
   * @param {Values} frame
   * @param {number} nowMs
   * @param {(name: string) => boolean} [shows] whether the page shows a signal
   * @returns {boolean} whether to draw them immediately; equal values of a robot at rest only have
   *   a new age
   */
  values(frame, nowMs, shows = () => true) {
    const sentMs = nowMs - this.lagMs(frame.n, nowMs);
    let isNew = frame.e !== undefined;
    frame.i.forEach((index, place) => {
      const name = this.names[index];
      if (name === undefined) return;
      const missed = this.each.take(frame.e, index, name);
      if (missed < 0) return;
      this.serial += 1;
      const [value, alarm] = [frame.v[place] ?? null, frame.s?.[place] ?? ""];
      const last = this.samples.get(name);
      const isSteady = last?.value === value && last.alarm === alarm && nowMs - last.timeMs <= STEADY_MS;
      isNew ||= !isSteady && shows(name);
      this.samples.set(name, {
        value,
        alarm,
        timeMs: sentMs - (typeof frame.a === "number" ? frame.a : (frame.a[place] ?? 0)),
        serial: this.serial,
      });
      this.each.tell(name, missed);
    });
    return isNew;
  }

  /**
   * Store an image or bytes of a signal.
   *
   * @param {import("./frames.js").BinaryFrame} frame
   * @param {number} nowMs
   */
  picture({ index, sentMs, ageMs, number, type, bytes, isRepeated }, nowMs) {
    const timeMs = nowMs - this.lagMs(sentMs, nowMs) - ageMs;
    const name = this.names[index];
    if (name === undefined) return;
    this.serial += 1;
    const blob = new Blob([bytes], { type });
    const image = { blob, type, serial: this.serial, signal: name, number, timeMs, isRepeated };
    const value = { bytes: bytes.byteLength };
    this.samples.set(name, { value, alarm: "", timeMs, serial: this.serial, image });
  }

  /**
   * Return the time of the measurement of a binary message, on the page's clock.
   *
   * @param {import("./frames.js").BinaryFrame} frame
   * @param {number} nowMs
   */
  timeOf({ sentMs, ageMs }, nowMs) {
    return nowMs - this.lagMs(sentMs, nowMs) - ageMs;
  }

  /**
   * Store a decoded image of a video. Its time is the time of its access unit, so a decoder that stands
   * still makes the reading stale.
   *
   * @param {string} name
   * @param {ImageBitmap} bitmap
   * @param {number} timeMs
   * @param {number} number number of its access unit
   * @param {number} [firstNumber] number of the image that the camera repeats
   * @param {import("./videos.js").Quality} [quality] what the page receives of the video
   */
  videoImage(name, bitmap, timeMs, number, firstNumber, quality) {
    this.serial += 1;
    this.samples.get(name)?.video?.bitmap.close();
    const value = { bytes: bitmap.width * bitmap.height };
    const video = { bitmap, serial: this.serial, signal: name, number, timeMs, firstNumber, quality };
    this.samples.set(name, { value, alarm: "", timeMs, serial: this.serial, video });
  }

  /**
   * Show all values in the units of a unit system.
   *
   * @param {string} system
   */
  setUnits(system) {
    this.units.use(system);
    this.edition += 1;
  }

  /**
   * @param {Link[]} links
   * @param {number} nowMs
   */
  setLinks(links, nowMs) {
    this.links = new Map(links.map((link) => [link.transport, link]));
    this.wasLive ||= links.some(({ state }) => isConnected(state));
    for (const { transport, state, since } of links) {
      if (isConnected(state)) this.downMs.delete(transport);
      // If a link is lost again while connecting, the first loss counts.
      else if (!this.downMs.has(transport)) this.downMs.set(transport, nowMs - since);
    }
    this.countLinks();
  }

  /**
   * Store the notes about the topics of a ROS robot.
   *
   * @param {import("../core/types.js").TopicMismatch[]} mismatches
   */
  setTopics(mismatches) {
    this.topics.take(mismatches);
    this.edition += 1;
  }

  /**
   * Return why signals have no live value, from the robot's topics; "" if the reason is unknown.
   *
   * @param {readonly string[]} names
   * @param {number} nowMs
   */
  topicNote(names, nowMs) {
    const notes = this.topics.signals;
    if (notes.size === 0) return "";
    const name = names.find((one) => notes.has(one) && this.state(one, nowMs) !== "live");
    return name === undefined ? "" : (notes.get(name) ?? "");
  }

  /**
   * A quick round trip proves that buffers are empty. If messages still seem late, a clock has
   * jumped, for example after sleep.
   *
   * @param {number} serverMs
   * @param {number} nowMs
   * @param {number | null} tripMs
   */
  pong(serverMs, nowMs, tripMs) {
    const lagMs = this.lagMs(serverMs, nowMs);
    if (tripMs !== null && tripMs < SHORT_TRIP_MS && lagMs > LONG_LAG_MS) {
      this.skewMs = nowMs - serverMs;
    }
  }

  /**
   * Return a value that changes whenever the reading must be drawn. It is called for each signal in
   * each frame, so for a live signal it is only the serial number.
   *
   * @param {string} name
   * @param {number} nowMs
   * @returns {number | string}
   */
  look(name, nowMs) {
    const sample = this.samples.get(name);
    if (!sample) return 0;
    const ageMs = Math.max(0, nowMs - sample.timeMs);
    const state = this.stateOf(this.signals.get(name) ?? UNKNOWN, sample, ageMs, nowMs);
    return state === "live" ? sample.serial : `${sample.serial} ${state} ${ageText(ageMs / 1000)}`;
  }

  /**
   * @param {string} name
   * @param {number} nowMs
   */
  state(name, nowMs) {
    const sample = this.samples.get(name);
    const ageMs = sample ? Math.max(0, nowMs - sample.timeMs) : 0;
    return this.stateOf(this.signals.get(name) ?? UNKNOWN, sample, ageMs, nowMs);
  }

  /**
   * @param {string} name
   * @param {number} nowMs
   * @param {Conversion} [conversion] conversion to the unit of the input
   * @returns {Reading}
   */
  reading(name, nowMs, conversion) {
    const declared = this.signals.get(name) ?? { name, type: "string" };
    const sample = this.samples.get(name);
    const ageMs = sample ? Math.max(0, nowMs - sample.timeMs) : 0;
    const state = this.stateOf(declared, sample, ageMs, nowMs);
    const isShown = sample && (state === "live" || state === "stale");
    const signal = conversion ? this.wantedAs(declared, conversion) : declared;
    const value = isShown ? converted(sample.value, conversion) : null;
    const shown = this.units.shown(signal.unit ?? "");
    return {
      value,
      state,
      alarm: isShown ? sample.alarm : "",
      priority: isShown ? priorityOf(sample.alarm, sample.value, declared) : "",
      // Computed on demand, because a scan has a thousand numbers that are rarely read as text.
      get text() {
        return textOf(value, signal, factorOf(shown));
      },
      unit: shown.symbol,
      age: state === "stale" || state === "gone" ? ageText(ageMs / 1000) : "",
      time: (sample?.timeMs ?? 0) / 1000,
      serial: sample?.serial ?? 0,
      signal,
      image: isShown ? (sample.image ?? null) : null,
      video: isShown ? (sample.video ?? null) : null,
    };
  }

  /**
   * Return the signal as if it were declared in another unit.
   *
   * @param {Signal} signal
   * @param {Conversion} conversion
   */
  wantedAs(signal, conversion) {
    const known = this.wanted.get(conversion);
    if (known?.name === signal.name && known.edition === this.edition) return known;
    const made = { ...signal, unit: conversion.symbol, edition: this.edition };
    const { factor, offset } = conversion;
    if (signal.min !== undefined) made.min = signal.min * factor + offset;
    if (signal.max !== undefined) made.max = signal.max * factor + offset;
    const limits = Object.entries(signal.limits ?? {});
    const precision = digitsIn(signal.precision, (value) => value * factor + offset);
    if (precision !== undefined) made.precision = precision;
    if (signal.limits) {
      made.limits = Object.fromEntries(limits.map(([key, at]) => [key, at * factor + offset]));
    }
    this.wanted.set(conversion, made);
    return made;
  }

  /**
   * @param {Signal} signal
   * @param {Sample | undefined} sample
   * @param {number} ageMs
   * @param {number} nowMs
   * @returns {State}
   */
  stateOf(signal, sample, ageMs, nowMs) {
    if (!sample || sample.value === null) return "none";
    const limitMs = (signal.stale_after_s ?? 0) * 1000;
    const cutOffMs = this.cutOffMs(signal, nowMs);
    const ageAtLossMs = ageMs - Math.max(0, cutOffMs);
    if (limitMs > 0 && ageAtLossMs > GONE_AFTER * limitMs) return "gone";
    if (limitMs > 0 && ageMs > limitMs) return "stale";
    return cutOffMs >= 0 ? "stale" : "live";
  }

  /**
   * Return the time for which the page or all links of a signal have been down, in milliseconds; -1
   * while a link is up.
   *
   * @param {Signal} signal
   * @param {number} nowMs
   */
  cutOffMs(signal, nowMs) {
    const [first] = signal.sources ?? [];
    if (this.isAllUp && (first === undefined || this.links.has(first))) return -1;
    const sources = signal.sources?.length ? signal.sources : [...this.links.keys()];
    const states = sources.map((source) => this.links.get(source)?.state);
    if (this.isUp && (states.length === 0 || states.some(isConnected))) return -1;
    // The link lost last counts; without a connection to URC, no later state is known.
    const downMs = sources.map((source) => this.downMs.get(source) ?? Infinity);
    const sinceMs = Math.max(-Infinity, ...downMs);
    const isKnown = Number.isFinite(sinceMs);
    if (!this.isUp) return nowMs - (isKnown ? Math.min(sinceMs, this.lostMs) : this.lostMs);
    return isKnown ? Math.max(0, nowMs - sinceMs) : 0;
  }

  /**
   * Return the age of a value that is shown although its link is lost, in milliseconds; -1 for any
   * other value.
   *
   * @param {string} name
   * @param {number} nowMs
   */
  lastAgeMs(name, nowMs) {
    const sample = this.samples.get(name);
    if (!sample || this.state(name, nowMs) !== "stale") return -1;
    if (this.cutOffMs(this.signals.get(name) ?? UNKNOWN, nowMs) < 0) return -1;
    return Math.max(0, nowMs - sample.timeMs);
  }

  /**
   * Reason why a command cannot be sent now; "" if it can be tried.
   *
   * @param {string} transport required transport; "" if it is opened for each command
   * @param {boolean} isMotion whether the command is motion, which does not wait for a connection
   */
  hindrance(transport, isMotion = false) {
    if (!this.isUp) return t("no connection to URC");
    const state = this.links.get(transport)?.state;
    if (state === "lost") return t("the robot is not connected");
    return isMotion && transport && !isConnected(state) ? t("the robot is not connected yet") : "";
  }

  /**
   * Return the extra delay of this message compared with the fastest message, in milliseconds.
   *
   * @param {number} serverMs
   * @param {number} nowMs
   */
  lagMs(serverMs, nowMs) {
    const skewMs = nowMs - serverMs;
    const known = this.skewMs + (nowMs - this.skewSetMs) * DRIFT;
    this.skewMs = Number.isFinite(known) ? Math.min(skewMs, known) : skewMs;
    this.skewSetMs = nowMs;
    return skewMs - this.skewMs;
  }
}

/** @param {Link["state"] | undefined} state */
function isConnected(state) {
  return state === "live" || state === "silent";
}
