"""Transcodes the video of a camera, to H.264 or to JPEG images, in the camera's process.

Only documents with `transcode` use this module, for codecs that browsers lack. A thread decodes and
encodes, so that reading goes on. A slow computer leaves out images: while newer ones wait, an image
is decoded and not encoded. If decoding alone is too slow, whole groups of pictures are left out.
"""

import threading
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any, Final

from urc._image_encoders import HARDWARE, SOFTWARE, FrameEncoder, jpeg_of
from urc.images import MAX_PIXELS
from urc.transports.camera_records import NOTE, UnitQueue, put_units, record_of
from urc.video import JPEG, VideoUnit, encode_unit, read_unit
from urc.video_reader import UnitReader, VideoFault

__all__ = ["ENCODERS", "Transcoder"]

ENCODERS: Final = {"h264": (*HARDWARE, SOFTWARE), "h264_software": (SOFTWARE,), "jpeg": ()}
"""Encoders of the library for H.264 in order of preference, keyed by the value of `transcode`."""
_WAITING: Final = 60
"""Maximum number of units that wait for the decoder."""
_BEHIND: Final = 1
"""Number of waiting units at which an image is decoded, but not encoded."""
_MOST_FAILURES: Final = 100
"""Number of decoded units in sequence without an image after which the stream cannot be used."""
_END_S: Final = 2.0
_NAMES: Final = {"hevc": "H.265", "mpeg4": "MPEG-4", "mjpeg": "JPEG", "rawvideo": "raw images"}
"""Names of codecs in messages, keyed by the library's name."""
_MICROSECOND: Final = Fraction(1, 1_000_000)


class Transcoder:
    """The decoder and encoder of one stream, in a thread."""

    def __init__(
        self,
        av: Any,
        name: str,
        make_decoder: Callable[[], Any],
        encoders: tuple[str, ...],
        queue: UnitQueue,
    ) -> None:
        """Start the thread.

        Args:
            av: the package PyAV.
            name: the library's name of the stream's codec.
            make_decoder: function that returns a new decoder of the library.
            encoders: the library's encoders for H.264, as in `ENCODERS`; () for JPEG images.
            queue: target of the access units, and of a line about the encoder.
        """
        self._av = av
        self._name = _NAMES.get(name, name)
        self._make_decoder = make_decoder
        self._encoders = encoders
        self._queue = queue
        self._encoder: FrameEncoder | None = None
        self._reader = UnitReader(is_hevc=False, began_s=0.0)
        self._told = ""
        """Codec and encoder that the log contains."""
        self._waiting = UnitQueue(max_units=_WAITING)
        self._fault = ""
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, units: Iterable[VideoUnit]) -> None:
        """Pass units to the thread, with their times of arrival.

        Raises:
            VideoFault: the stream cannot be decoded, or no encoder works.
        """
        if self._fault:
            raise VideoFault(self._fault)
        for unit in units:
            self._waiting.put(encode_unit(unit), is_key=unit.is_key)

    def end(self) -> None:
        """Encode the units that wait, then end the thread."""
        self._waiting.end()
        self._thread.join(_END_S)

    def _run(self) -> None:
        try:
            self._transcode()
        except VideoFault as fault:
            self._fault = str(fault)
        except Exception as bug:  # supervisor: `put` reports the reason
            self._fault = f"the video cannot be transcoded ({type(bug).__name__}: {bug})"

    def _transcode(self) -> None:
        decoder: Any = None
        needs_key, failures = True, 0
        while (unit := self._next_unit()) is not None:
            if needs_key and not unit.is_key:
                continue
            decoder = decoder or self._make_decoder()
            frames = self._decoded(decoder, unit)
            needs_key = frames is None
            if frames is None:
                decoder = None
            failures = 0 if frames else failures + 1
            if failures > _MOST_FAILURES:
                raise VideoFault(f"the camera's {self._name} cannot be decoded")
            if self._waiting.count <= _BEHIND:
                for frame in frames or ():
                    self._encode(frame)

    def _next_unit(self) -> VideoUnit | None:
        """Return the next unit, after a wait if necessary; None at the end."""
        value = self._waiting.take()
        return None if value is None else read_unit(value)

    def _decoded(self, decoder: Any, unit: VideoUnit) -> list[Any] | None:
        """Return the frames of a unit; None if a new decoder is necessary."""
        packet = self._av.Packet(unit.data)
        packet.pts = packet.dts = round(unit.time_s * 1e6)
        packet.time_base = _MICROSECOND
        try:
            frames: list[Any] = decoder.decode(packet)
        except self._av.error.FFmpegError:
            return None
        for frame in frames:
            if frame.width * frame.height > MAX_PIXELS:
                raise VideoFault(
                    f"the camera sends images of {frame.width} by {frame.height} pixels; the limit"
                    f" is {MAX_PIXELS} in total: select a smaller image in the camera's settings"
                )
        return [frame for frame in frames if frame.pts is not None]

    def _encode(self, frame: Any) -> None:
        time_s, width, height = frame.pts / 1e6, frame.width, frame.height
        if not self._encoders:
            unit = VideoUnit(JPEG, True, width, height, time_s, jpeg_of(self._av, frame))
            put_units([unit], self._queue)
            self._tell(frame, "JPEG")
            return
        if self._encoder is None:
            self._encoder = FrameEncoder(self._av, time_s, self._encoders)
            self._reader = UnitReader(is_hevc=False, began_s=time_s)
        for made in self._encoder.encode(frame, time_s):
            found = self._reader.unit(made.data, made.time_s)
            put_units([found] if found is not None else [], self._queue)
        self._tell(frame, f"H.264, with {self._encoder.name}")

    def _tell(self, frame: Any, what: str) -> None:
        """Put a line about the encoder into the queue, unless it is there already."""
        if self._told != what:
            self._told = what
            size = f"{frame.width} × {frame.height} pixels"
            words = f"transcodes {self._name} of {size} to {what}"
            self._queue.tell(record_of(NOTE, words.encode()))
