// @ts-check
/**
 * The page's videos: access units go to a worker, and decoded images come back into the store.
 *
 * Browsers decode videos only on pages over HTTPS or on localhost. On other pages, and for codecs that the
 * browser lacks, the page requests JPEG images instead.
 */
import { scriptUrl } from "../core/trusted_scripts.js";
import { FIRST_LOW } from "./frames.js";
import { StandingPictures } from "./standing_pictures.js";

/** Number of faults of a video after which the page requests JPEG images. */
const MOST_FAULTS = 3;
/** Number of images in sequence after which earlier faults no longer count: datagrams may be lost at any time. */
const FORGIVEN_AFTER = 100;
/** Number of access units by which an image may leave the decoder early: a camera with B-frames reorders images. */
const MOST_REORDERED = 16;
/** Maximum number of access units without an image; the browser then decodes too slowly, or not at all. */
const MOST_TIMES = 2000;

/** @param {number} number number of an access unit */
const isOfLow = (number) => number > FIRST_LOW;

/**
 * @param {string} signal
 * @param {number} number
 */
const streamOf = (signal, number) => (isOfLow(number) ? `${signal}#low` : signal);

/**
 * @typedef {object} Quality
 * @property {boolean} isLow Whether the page receives the low stream of the camera.
 * @property {boolean} isSparse Whether the page receives keyframes only.
 * @property {number} of Number of images from one keyframe to the next on such a page; 0 while unknown.
 */

export class Videos {
  /**
   * @param {import("./store.js").Store} store
   * @param {() => void} changed called for each new image
   * @param {() => void} refused called for each video that the page cannot decode
   * @param {() => Worker} [start]
   */
  constructor(store, changed, refused, start = () => new Worker(scriptUrl("video"))) {
    this.store = store;
    this.changed = changed;
    this.refused = refused;
    this.start = start;
    this.canDecode = isSecureContext && typeof VideoDecoder === "function";
    /** @type {Worker | null} */
    this.worker = null;
    /** Time of each access unit in the decoder, by signal and number. @type {Map<string, Map<number, number>>} */
    this.times = new Map();
    /** Keyframes of compared videos, by stream; kept while a video is hidden. @type {Map<string, StandingPictures>} */
    this.standing = new Map();
    /** Newest access unit of each video. @type {Map<string, import("./frames.js").BinaryFrame>} */
    this.newest = new Map();
    /** What the page receives of each video. @type {Map<string, Quality>} */
    this.qualities = new Map();
    /** Faults of each video, and the images since the last one. @type {Map<string, {count: number, images: number}>} */
    this.faults = new Map();
    /** Videos that the page cannot decode. @type {Set<string>} */
    this.stills = new Set();
  }

  /**
   * @param {import("./frames.js").BinaryFrame} frame
   * @param {number} nowMs
   */
  take(frame, nowMs) {
    const { video, number } = frame;
    const timeMs = this.store.timeOf(frame, nowMs);
    const signal = this.store.names[frame.index];
    if (!video || signal === undefined || this.stills.has(signal)) return;
    const times = this.times.get(signal) ?? new Map();
    this.times.set(signal, times);
    this.note(signal, frame);
    if (times.size >= MOST_TIMES) times.clear();
    times.set(number, timeMs);
    const data = frame.bytes.slice().buffer;
    const isCompared = this.frozenAfterMs(signal) > 0;
    const unit = { signal, number, timeMs, isKey: video.isKey, codec: frame.type, data, isCompared };
    this.decoder().postMessage(unit, [data]);
  }

  /**
   * Note what the page receives of a video, and the change between its streams.
   *
   * @param {string} signal
   * @param {import("./frames.js").BinaryFrame} frame
   */
  note(signal, frame) {
    const last = this.newest.get(signal);
    this.newest.set(signal, frame);
    const isLow = isOfLow(frame.number);
    const isSparse = frame.video?.isSparse === true;
    const isSame = last !== undefined && isOfLow(last.number) === isLow;
    if (last && !isSame) {
      this.times.get(signal)?.clear();
      const standing = this.standing.get(streamOf(signal, last.number));
      if (standing?.since) this.standingOf(signal, frame.number).inherit(standing.since);
    }
    // The image before the first keyframe alone may have been any image of its group.
    const of = isSame && isSparse && last.video?.isSparse ? frame.number - last.number : 0;
    this.qualities.set(signal, { isLow, isSparse, of });
  }

  /** Return the time after which equal images count as one; 0 for never. @param {string} signal */
  frozenAfterMs(signal) {
    return (this.store.signals.get(signal)?.frozen_after_s ?? 0) * 1000;
  }

  /** Return the names of the shown videos that the page cannot decode. @param {readonly string[]} shown */
  undecoded(shown) {
    const videos = shown.filter((name) => this.store.signals.get(name)?.type === "video");
    return this.canDecode ? videos.filter((name) => this.stills.has(name)) : videos;
  }

  /** End all videos that are not shown. @param {readonly string[]} shown */
  keep(shown) {
    for (const signal of this.times.keys()) {
      if (shown.includes(signal) && !this.stills.has(signal)) continue;
      this.times.delete(signal);
      this.newest.delete(signal);
      this.qualities.delete(signal);
      this.worker?.postMessage({ signal, isOver: true });
    }
  }

  decoder() {
    if (this.worker) return this.worker;
    const worker = this.start();
    worker.addEventListener("message", ({ data }) => this.answer(data));
    worker.addEventListener("error", () => this.giveUp());
    this.worker = worker;
    return worker;
  }

  /** @param {{signal: string, number: number, timeMs?: number, bitmap?: ImageBitmap, blocks?: Uint32Array, fault?: string}} told */
  answer({ signal, number, timeMs: keyMs, bitmap, blocks, fault }) {
    if (blocks && keyMs !== undefined) {
      this.standingOf(signal, number).add({ number, timeMs: keyMs, blocks });
      return;
    }
    if (fault !== undefined) {
      this.fail(signal, fault);
      return;
    }
    const times = this.times.get(signal);
    if (!bitmap) return;
    const timeMs = times?.get(number);
    if (timeMs === undefined) {
      bitmap.close();
      return;
    }
    times?.delete(number);
    for (const known of times?.keys() ?? []) {
      if (known > number - MOST_REORDERED) break;
      times?.delete(known);
    }
    const faults = this.faults.get(signal);
    if (faults && (faults.images += 1) >= FORGIVEN_AFTER) this.faults.delete(signal);
    const afterMs = this.frozenAfterMs(signal);
    const first = afterMs > 0 ? this.standingOf(signal, number).first(timeMs, afterMs) : null;
    const quality = this.qualities.get(signal);
    this.store.videoImage(signal, bitmap, first?.timeMs ?? timeMs, number, first?.number, quality);
    this.changed();
  }

  /**
   * Return the comparison of keyframes of the stream that contains an access unit.
   *
   * @param {string} signal
   * @param {number} number
   */
  standingOf(signal, number) {
    const stream = streamOf(signal, number);
    const known = this.standing.get(stream) ?? new StandingPictures();
    this.standing.set(stream, known);
    return known;
  }

  /**
   * @param {string} signal
   * @param {string} fault
   */
  fail(signal, fault) {
    const count = (this.faults.get(signal)?.count ?? 0) + 1;
    this.faults.set(signal, { count, images: 0 });
    console.info(`URC: the video ${signal} cannot be decoded:`, fault);
    if (count < MOST_FAULTS && !/^[a-z0-9.]+$/i.test(fault)) return;
    this.stills.add(signal);
    this.refused();
  }

  /** Request JPEG images for all videos, because the worker does not run. */
  giveUp() {
    this.canDecode = false;
    this.worker?.terminate();
    this.worker = null;
    this.times.clear();
    this.refused();
  }
}
