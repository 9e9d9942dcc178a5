"""Interfaces and shared code of the framings.

Pure. Each framing works in both directions, so that the emulated robot uses the same declaration
(`reversed`).

Theory of operation. A decoder removes frames from the front of a `ReceiveBuffer`, one per call.
Remaining bytes stay in the buffer, so that another decoder can continue when a reply has its own
framing. Memory is bounded: the buffer never exceeds the longest frame. Time is linear: bytes are
scanned once, or again only within a `RescanBudget`. After invalid bytes the decoder reports one
violation, and continues where the next frame may begin.
"""

from collections.abc import Callable
from typing import Final, NamedTuple, Protocol, cast

from urc.model.driver import FramingSpec
from urc.model.framing import FrameLayout
from urc.problems import UrcError
from urc.protocol.framing.frame import BadFrame, FrameCodec
from urc.protocol.framing.receive_buffer import ReceiveBuffer

__all__ = [
    "SKIPPED",
    "Decoder",
    "FrameFault",
    "Framing",
    "FramingError",
    "Open",
    "StreamDecoder",
    "frame_codec_of",
    "encode_frame",
]

SKIPPED: Final = ""
"""Code of a frame that is dropped silently; only a `switch` sees it."""
Open = Callable[[bytes], bytes]


class FramingError(UrcError):
    """A payload that this framing cannot carry."""


class FrameFault(NamedTuple):
    """Bytes that are not a valid frame."""

    code: str
    """``frame-too-long``, ``bad-checksum``, ``no-frame`` …"""
    message: str
    closes: bool = False
    """Whether the connection must be closed."""


class Decoder(Protocol):
    """Cuts one stream. Each connection has a new decoder, without old data."""

    @property
    def pending(self) -> int:
        """Buffered bytes of an incomplete frame."""

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` may complete a frame; None when only bytes can."""

    def feed(self, data: bytes, now: float = 0.0) -> list[bytes | FrameFault]:
        """Append bytes and return the completed frames, in order."""

    def push(self, data: bytes, now: float = 0.0) -> None:
        """Append bytes for `next`."""

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Remove one frame or violation from the stream and return it; None if incomplete."""

    def tick(self, now: float) -> list[bytes | FrameFault]:
        """Return the frames that the silence until `now` has completed."""


class Framing(Protocol):
    """One method of cutting frames, with its options."""

    def encode(self, payload: bytes) -> bytes:
        """Return the bytes of one frame; raise `FramingError` if it would be ambiguous."""

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for the bytes in `stream` and all that follow."""

    def reversed(self) -> "Framing":
        """Return the same framing for the other end of the connection."""


class StreamDecoder:
    """Shared code of the decoders. A subclass adds `next`."""

    def __init__(self, stream: ReceiveBuffer | None, max_bytes: int) -> None:
        self._stream = ReceiveBuffer() if stream is None else stream
        self._max_bytes = max_bytes
        self._is_lost = False
        """Whether the bytes since the last frame are invalid, which is reported once."""
        self._is_case = False
        """Whether a `switch` chooses a case after each frame."""

    @property
    def pending(self) -> int:
        """Bytes held back."""
        return len(self._stream)

    @property
    def deadline(self) -> float | None:
        """Always None, because only bytes complete a frame."""
        return None

    def push(self, data: bytes, now: float = 0.0) -> None:
        """Append bytes for `next`."""
        self._stream.push(data)

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Return one frame or violation, or None if incomplete."""
        raise NotImplementedError

    def feed(self, data: bytes, now: float = 0.0) -> list[bytes | FrameFault]:
        """Append bytes and return the completed frames, in order."""
        self.push(data, now)
        frames: list[bytes | FrameFault] = []
        while (frame := self.next(now)) is not None:
            frames.append(frame)
        return frames

    def tick(self, now: float) -> list[bytes | FrameFault]:
        """Return an empty list: silence completes no frames."""
        return []

    def restart(self) -> None:
        """Reset the state: a `switch` begins a frame of this case here."""
        self._is_lost = False
        self._is_case = True

    def _refused(self, error: BadFrame) -> FrameFault | None:
        """Return the violation for an invalid frame, or None if it is dropped silently."""
        if error.code == SKIPPED and not self._is_case:
            return None
        return FrameFault(error.code, str(error), error.closes)

    def _before(self, mark: bytes) -> int:
        """Return the number of bytes before the next `mark`, or before its possible beginning."""
        stream, data = self._stream, self._stream.data
        found = data.find(mark, stream.at)
        if found < 0:
            found = max(stream.at, len(data) - len(mark) + 1)
            while not mark.startswith(data[found:]):
                found += 1
        return found - stream.at

    def _skip(self, count: int) -> FrameFault | None:
        """Discard bytes that begin no frame; return a violation for the first of them."""
        stream = self._stream
        first = stream.data[stream.at : stream.at + 1]
        stream.at += count
        return self._lost(
            "no-frame", f"bytes from {first.hex()} on begin no frame; skipped up to the next frame"
        )

    def _lost(self, code: str, message: str, *, closes: bool = False) -> FrameFault | None:
        """Return a violation, or None if this run of invalid bytes has already been reported."""
        if self._is_lost:
            return None
        self._is_lost = True
        return FrameFault(code, message, closes)


def frame_codec_of(spec: FramingSpec) -> FrameCodec | None:
    """Return the frame codec of `spec`, or None when payloads are the frames themselves."""
    layout = cast("FrameLayout | None", spec.options.get("layout"))
    return None if layout is None or layout == FrameLayout() else FrameCodec(layout)


def encode_frame(codec: FrameCodec | None, payload: bytes, max_bytes: int) -> bytes:
    """Return the frame around `payload`; raise `FramingError` if it cannot be framed."""
    try:
        frame = payload if codec is None else codec.close(payload)
    except BadFrame as error:
        raise FramingError(str(error)) from None
    if len(frame) > max_bytes:
        raise FramingError(f"a frame of {len(frame)} bytes is longer than {max_bytes}")
    return frame
