"""Encoders of single images as H.264 and JPEG, for processes that have the extra `video`.

Each image becomes one access unit or file as soon as possible: no image waits for a later one.
"""

from collections.abc import Sequence
from fractions import Fraction
from typing import Any, Final, NamedTuple

__all__ = ["HARDWARE", "KEYFRAME_EVERY_S", "SOFTWARE", "EncodedFrame", "FrameEncoder", "jpeg_of"]

KEYFRAME_EVERY_S: Final = 1.0
"""Time between two keyframes, in seconds. A new viewer waits for a keyframe."""
SOFTWARE: Final = "libx264"
HARDWARE: Final = ("h264_nvenc", "h264_qsv", "h264_amf", "h264_videotoolbox", "h264_v4l2m2m")
"""Encoders of the library that use hardware, in order of preference."""
_LIMITED, _BT601 = 1, 5
"""Range and matrix of the colours, as numbers of the library."""
_RATE: Final = 30
"""Highest number of images in a second, from which the encoder computes the level of the stream."""
_TICKS: Final = 90_000
"""Units of a time stamp in a second."""
_QUALITY: Final = 5
"""Quantiser of the JPEG encoder: 2 is the best image, 31 the smallest file."""
_OPTIONS: Final = {
    SOFTWARE: {
        "preset": "ultrafast",
        "tune": "zerolatency",
        "profile": "baseline",
        "forced-idr": "1",
    },
    "h264_nvenc": {"preset": "p1", "tune": "ull", "zerolatency": "1", "forced-idr": "1"},
    "h264_qsv": {"preset": "veryfast", "async_depth": "1", "forced_idr": "1"},
    "h264_amf": {"usage": "ultralowlatency", "forced_idr": "1"},
    "h264_videotoolbox": {"realtime": "1"},
    "h264_v4l2m2m": {},
}


class EncodedFrame(NamedTuple):
    """One access unit."""

    is_key: bool
    """Whether decoding can start with this image."""
    time_s: float
    """Time of the image, in seconds."""
    data: bytes
    """The access unit with start codes; a keyframe contains its parameter sets."""


class FrameEncoder:
    """An encoder, which begins a new stream if the size of the images changes."""

    def __init__(self, av: Any, began_s: float, names: Sequence[str] = (SOFTWARE,)) -> None:
        """Create an encoder.

        Args:
            av: the package PyAV.
            began_s: time of the first image or earlier, in seconds.
            names: the library's encoders; the first one that works is used.
        """
        self._av = av
        self._began_s = began_s
        self._names = [one for one in names if one in av.codecs_available]
        self._codec: Any = None
        self._key_s = began_s
        self._last_pts = -1
        self._times_s: dict[int, float] = {}
        """Times of the images in the encoder, keyed by time stamp."""

    @property
    def name(self) -> str:
        """Name of the library's encoder."""
        return self._names[0] if self._names else ""

    def encode(self, frame: Any, time_s: float, *, is_key: bool = False) -> list[EncodedFrame]:
        """Return the access units that are ready: for the software encoder, always one.

        Args:
            frame: the decoded image, a frame of the library.
            time_s: time of the image, in seconds. An encoder with a delay returns it later.
            is_key: whether the image must become a keyframe.

        Raises:
            av.error.FFmpegError: no encoder can encode the image.
        """
        while True:
            try:
                return self._encoded(frame, time_s, is_key=is_key)
            except self._av.error.FFmpegError:
                if len(self._names) <= 1:
                    raise
                del self._names[0]
                self._codec = None

    def _encoded(self, frame: Any, time_s: float, *, is_key: bool) -> list[EncodedFrame]:
        width, height = max(2, frame.width & ~1), max(2, frame.height & ~1)
        if self._codec is None or (self._codec.width, self._codec.height) != (width, height):
            self._codec, is_key = self._opened(width, height, _matrix(frame)), True
            self._times_s.clear()
        plain = frame.reformat(
            width=width, height=height, format=self._codec.pix_fmt, dst_color_range="MPEG"
        )
        is_key = is_key or time_s - self._key_s >= KEYFRAME_EVERY_S
        if is_key:
            self._key_s = time_s
        types = self._av.video.frame.PictureType
        plain.pict_type = types.I if is_key else types.NONE
        self._last_pts = max(self._last_pts + 1, round((time_s - self._began_s) * _TICKS))
        plain.pts, plain.time_base = self._last_pts, Fraction(1, _TICKS)
        self._times_s[self._last_pts] = time_s
        return [
            EncodedFrame(one.is_keyframe, self._times_s.pop(one.pts, time_s), bytes(one))
            for one in self._codec.encode(plain)
        ]

    def _opened(self, width: int, height: int, matrix: int) -> Any:
        codec = self._av.CodecContext.create(self.name, "w")
        formats = [one.name for one in codec.codec.video_formats or ()]
        codec.width, codec.height = width, height
        codec.pix_fmt = "nv12" if "nv12" in formats and "yuv420p" not in formats else "yuv420p"
        codec.time_base, codec.framerate = Fraction(1, _TICKS), _RATE
        codec.color_range, codec.colorspace = _LIMITED, matrix
        codec.gop_size = 1_000_000  # `encode` chooses the keyframes, by time
        codec.max_b_frames = 0
        codec.thread_count = 1
        codec.options = _OPTIONS[self.name]
        return codec


def jpeg_of(av: Any, frame: Any, widest: int = 65_534) -> bytes:
    """Return a decoded image as a JPEG file, scaled to a width of at most `widest` pixels.

    Raises:
        av.error.FFmpegError: the image cannot be encoded.
    """
    width, height = frame.width, frame.height
    if width > widest:
        width, height = widest, max(2, round(height * widest / width / 2) * 2)
    plain = frame.reformat(width, height, "yuvj420p")
    encoder = av.CodecContext.create("mjpeg", "w")
    encoder.width, encoder.height, encoder.pix_fmt = width, height, "yuvj420p"
    encoder.time_base = Fraction(1, _RATE)
    encoder.options = {"qmin": str(_QUALITY), "qmax": str(_QUALITY)}
    plain.pts = 0
    packets = [*encoder.encode(plain), *encoder.encode(None)]
    return b"".join(bytes(packet) for packet in packets)


def _matrix(frame: Any) -> int:
    """Return the matrix of a frame's colours after its conversion to YUV."""
    return _BT601 if frame.format.is_rgb else int(frame.colorspace)
