// @ts-check
/**
 * Decoder of videos, outside the page's thread. A script without imports, because it runs in a worker.
 *
 * The page posts access units: {signal, number, timeMs, isKey, codec, data, isCompared}, and {signal, isOver:
 * true} at the end of a video. The worker posts images: {signal, number, bitmap}, and faults: {signal, fault}. Of
 * compared videos, it also posts the checksums of each keyframe: {signal, number, timeMs, blocks}.
 */

/** Number of waiting access units at which a keyframe replaces them: 0.4 s at 30 images a second. */
const LATE_UNITS = 12;
/** Number of waiting access units at which further ones are dropped until the next keyframe. */
const MOST_UNITS = 300;
/** Number before the first access unit of a low stream. */
const FIRST_LOW = 2 ** 31;
/** Numbers of compared blocks in a row and in a column. */
const [COLUMNS, ROWS] = [20, 15];

/** Posts a message to the page. @param {object} message @param {Transferable[]} [moved] */
function tell(message, moved = []) {
  /** @type {any} */ (globalThis).postMessage(message, moved);
}

/** Return the checksums of an image's blocks. @param {VideoFrame} frame */
async function blocksOf(frame) {
  try {
    const data = new Uint8Array(frame.allocationSize());
    const [brightness] = await frame.copyTo(data);
    const { offset = 0, stride = 0 } = brightness ?? {};
    return checksums(data.subarray(offset), stride, frame.visibleRect?.height ?? 0);
  } catch {
    return blocksOfPixels(frame); // a decoder may keep its images where a page cannot read them
  }
}

/** @param {VideoFrame} frame */
function blocksOfPixels(frame) {
  const [width, height] = [frame.displayWidth, frame.displayHeight];
  const pen = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
  pen?.drawImage(frame, 0, 0);
  const pixels = pen?.getImageData(0, 0, width, height);
  return checksums(new Uint8Array(pixels?.data ?? []), 4 * width, pixels ? height : 0);
}

/**
 * Return the checksums of 300 blocks with 8 rows of 8 bytes, spread over the image. They lie within the blocks
 * of an encoder, whose edges depend on their neighbours. Noise of one bit changes a checksum.
 *
 * @param {Uint8Array} data
 * @param {number} stride bytes from one row to the next
 * @param {number} height
 */
function checksums(data, stride, height) {
  const found = new Uint32Array(COLUMNS * ROWS);
  if (stride < 16 || height < 16) return found.subarray(0, 0);
  for (let block = 0; block < found.length; block += 1) {
    const left = placeOf(block % COLUMNS, COLUMNS, stride);
    const top = placeOf(Math.floor(block / COLUMNS), ROWS, height);
    let hash = block;
    for (let place = 0; place < 64; place += 1) {
      const byte = data[(top + (place >> 3)) * stride + left + (place & 7)] ?? 0;
      hash = Math.imul((hash << 5) ^ (hash >>> 27) ^ byte, 0x01000193);
    }
    found[block] = hash;
  }
  return found;
}

/** Return the first byte or row of a block. @param {number} number @param {number} count @param {number} size */
function placeOf(number, count, size) {
  return Math.floor((number * size) / count / 16) * 16 + 4;
}

class Video {
  /** @param {string} signal */
  constructor(signal) {
    this.signal = signal;
    this.codec = "";
    /** @type {VideoDecoder | null} */
    this.decoder = null;
    /** Units that wait for the answer whether the codec is supported. @type {EncodedVideoChunk[] | null} */
    this.early = null;
    this.needsKey = true;
    this.isLow = false;
    this.isOver = false;
    /** Newest decoded image that is not posted yet. @type {VideoFrame | null} */
    this.next = null;
    this.isPosting = false;
    /** Times of the keyframes in the decoder that will be compared, by number. @type {Map<number, number>} */
    this.keys = new Map();
  }

  /** @param {{number: number, timeMs: number, isKey: boolean, codec: string, data: ArrayBuffer, isCompared: boolean}} unit */
  take({ number, timeMs, isKey, codec, data, isCompared }) {
    if (this.needsKey && !isKey) return;
    const waiting = this.early?.length ?? this.decoder?.decodeQueueSize ?? 0;
    const isOther = number > FIRST_LOW !== this.isLow;
    if (isKey && isOther) this.keys.clear();
    if (isKey && (codec !== this.codec || isOther || !this.decoder || waiting > LATE_UNITS)) this.begin(codec);
    else if (waiting > MOST_UNITS) {
      this.needsKey = true;
      return;
    }
    this.needsKey = false;
    this.isLow = number > FIRST_LOW;
    if (isKey && isCompared) this.keys.set(number, timeMs);
    const chunk = new EncodedVideoChunk({ type: isKey ? "key" : "delta", timestamp: number, data });
    if (this.early) this.early.push(chunk);
    else this.decode(chunk);
  }

  /** Start a decoder, or start it anew without its waiting units. @param {string} codec */
  begin(codec) {
    const config = { codec, optimizeForLatency: true };
    if (this.decoder && codec === this.codec && !this.early) {
      this.decoder.reset();
      this.decoder.configure(config);
      return;
    }
    this.decoder?.close();
    this.codec = codec;
    const decoder = new VideoDecoder({
      output: (frame) => this.output(frame),
      error: (error) => this.fail(decoder, String(error.message)),
    });
    this.decoder = decoder;
    this.early = [];
    VideoDecoder.isConfigSupported(config).then(
      ({ supported }) => this.start(decoder, config, supported === true),
      (error) => this.fail(decoder, String(error)),
    );
  }

  /**
   * @param {VideoDecoder} decoder
   * @param {VideoDecoderConfig} config
   * @param {boolean} isSupported
   */
  start(decoder, config, isSupported) {
    if (decoder !== this.decoder || decoder.state === "closed") return;
    const early = this.early ?? [];
    this.early = null;
    if (!isSupported) {
      this.fail(decoder, config.codec);
      return;
    }
    decoder.configure(config);
    for (const chunk of early) this.decode(chunk);
  }

  /** @param {EncodedVideoChunk} chunk */
  decode(chunk) {
    const { decoder } = this;
    if (!decoder || decoder.state !== "configured") return;
    try {
      decoder.decode(chunk);
    } catch (error) {
      this.fail(decoder, String(error));
    }
  }

  /** Post an image, or keep only the newest one while an earlier image is being posted. @param {VideoFrame} frame */
  output(frame) {
    const timeMs = this.keys.get(frame.timestamp);
    if (timeMs !== undefined) void this.compare(frame.clone(), timeMs);
    this.next?.close();
    this.next = frame;
    if (!this.isPosting) void this.post();
  }

  async post() {
    this.isPosting = true;
    while (this.next) {
      const frame = this.next;
      this.next = null;
      try {
        const bitmap = await createImageBitmap(frame);
        if (this.isOver) bitmap.close();
        else tell({ signal: this.signal, number: frame.timestamp, bitmap }, [bitmap]);
      } finally {
        frame.close();
      }
    }
    this.isPosting = false;
  }

  /**
   * Post the checksums of a keyframe.
   *
   * @param {VideoFrame} frame
   * @param {number} timeMs
   */
  async compare(frame, timeMs) {
    const number = frame.timestamp;
    // A decoder that starts anew leaves earlier keyframes out.
    for (const key of this.keys.keys()) if (key <= number) this.keys.delete(key);
    try {
      const blocks = await blocksOf(frame);
      if (!this.isOver) tell({ signal: this.signal, number, timeMs, blocks });
    } finally {
      frame.close();
    }
  }

  /**
   * @param {VideoDecoder} decoder
   * @param {string} fault
   */
  fail(decoder, fault) {
    if (decoder !== this.decoder || this.isOver) return;
    this.decoder = null;
    this.early = null;
    this.needsKey = true;
    if (decoder.state !== "closed") decoder.close();
    tell({ signal: this.signal, fault });
  }

  end() {
    this.isOver = true;
    if (this.decoder && this.decoder.state !== "closed") this.decoder.close();
    this.decoder = null;
    this.next?.close();
    this.next = null;
  }
}

/** @type {Map<string, Video>} */
const videos = new Map();

addEventListener("message", ({ data }) => {
  const known = videos.get(data.signal);
  if (data.isOver) {
    known?.end();
    videos.delete(data.signal);
    return;
  }
  const video = known ?? new Video(data.signal);
  videos.set(data.signal, video);
  video.take(data);
});
