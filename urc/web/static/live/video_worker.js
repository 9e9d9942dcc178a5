// @ts-check
/**
 * Decoder of videos, outside the page's thread. A script without imports, because it runs in a worker.
 *
 * The page posts access units: {signal, number, isKey, codec, data}, and {signal, isOver: true} at the end of
 * a video. The worker posts images: {signal, number, bitmap}, and faults: {signal, fault}.
 */

/** Number of waiting access units at which a keyframe replaces them: 0.4 s at 30 images a second. */
const LATE_UNITS = 12;
/** Number of waiting access units at which further ones are dropped until the next keyframe. */
const MOST_UNITS = 300;

/** Posts a message to the page. @param {object} message @param {Transferable[]} [moved] */
function tell(message, moved = []) {
  /** @type {any} */ (globalThis).postMessage(message, moved);
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
    this.isOver = false;
    /** Newest decoded image that is not posted yet. @type {VideoFrame | null} */
    this.next = null;
    this.isPosting = false;
  }

  /** @param {{number: number, isKey: boolean, codec: string, data: ArrayBuffer}} unit */
  take({ number, isKey, codec, data }) {
    if (this.needsKey && !isKey) return;
    const waiting = this.early?.length ?? this.decoder?.decodeQueueSize ?? 0;
    if (isKey && (codec !== this.codec || !this.decoder || waiting > LATE_UNITS)) this.begin(codec);
    else if (waiting > MOST_UNITS) {
      this.needsKey = true;
      return;
    }
    this.needsKey = false;
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
