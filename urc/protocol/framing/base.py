"""Interfaces and shared code for the framings.

Pure. Each framing works in both directions, so an emulated robot can use the same declaration
(`reversed`).

Theory of operation. A decoder removes frames from the front of a `ReceiveBuffer`, one per call.
Remaining bytes stay in the buffer, so another decoder can take over if a reply has a different
framing. Memory is bounded: the buffer never exceeds the maximum frame size. Time is linear: bytes
are scanned once and rescanned only within a `RescanBudget`. After invalid bytes, the decoder
reports one violation and continues at the next possible start of a frame.
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
"""Violation code of a frame that is dropped without being reported."""
Open = Callable[[bytes], bytes]


class FramingError(UrcError):
    """The framing cannot encode the payload."""


class FrameFault(NamedTuple):
    """A framing violation: received bytes that are not a valid frame."""

    code: str
    """Violation code: ``frame-too-long``, ``bad-checksum``, ``no-frame`` and others."""
    message: str
    closes: bool = False
    """Whether the connection must be closed because of the violation."""


class Decoder(Protocol):
    """A decoder that cuts one byte stream into frames.

    Every connection starts with a new decoder.
    """

    @property
    def pending(self) -> int:
        """Number of buffered bytes of an incomplete frame."""

    @property
    def deadline(self) -> float | None:
        """Time at which `tick` may complete a frame; None if only more bytes can complete it."""

    def feed(self, data: bytes, now: float = 0.0) -> list[bytes | FrameFault]:
        """Append received bytes; return the completed frames and violations in order."""

    def push(self, data: bytes, now: float = 0.0) -> None:
        """Append received bytes for `next` to decode."""

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Remove and return the next frame or violation; return None if it is incomplete."""

    def tick(self, now: float) -> list[bytes | FrameFault]:
        """Return the frames and violations completed by silence until `now`."""


class Framing(Protocol):
    """A framing method with its options."""

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for the bytes in `stream` and all later bytes."""

    def reversed(self) -> "Framing":
        """Return the framing for the other end of the connection."""


class StreamDecoder:
    """Base class of the decoders. Each decoder class implements `next`."""

    def __init__(self, stream: ReceiveBuffer | None, max_bytes: int) -> None:
        self._stream = ReceiveBuffer() if stream is None else stream
        self._max_bytes = max_bytes
        self._is_lost = False
        """Whether the bytes since the last frame are invalid; invalid bytes are reported once."""
        self._is_case = False
        """Whether the decoder reads the frames of one case of a `switch`."""

    @property
    def pending(self) -> int:
        """Number of buffered bytes of an incomplete frame."""
        return len(self._stream)

    @property
    def deadline(self) -> float | None:
        """None, because silence never completes a frame."""
        return None

    def push(self, data: bytes, now: float = 0.0) -> None:
        """Append received bytes for `next` to decode."""
        self._stream.push(data)

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Remove and return the next frame or violation; return None if it is incomplete."""
        raise NotImplementedError

    def feed(self, data: bytes, now: float = 0.0) -> list[bytes | FrameFault]:
        """Append received bytes; return the completed frames and violations in order."""
        self.push(data, now)
        frames: list[bytes | FrameFault] = []
        while (frame := self.next(now)) is not None:
            frames.append(frame)
        return frames

    def tick(self, now: float) -> list[bytes | FrameFault]:
        """Return an empty list, because silence never completes a frame."""
        return []

    def restart(self) -> None:
        """Prepare the decoder for a frame that a `switch` has assigned to it."""
        self._is_lost = False
        self._is_case = True

    def _refused(self, error: BadFrame) -> FrameFault | None:
        """Return the violation for an invalid frame; None if the frame is dropped silently."""
        if error.code == SKIPPED and not self._is_case:
            return None
        return FrameFault(error.code, str(error), error.closes)

    def _before(self, mark: bytes) -> int:
        """Return the number of bytes before the next complete or partial `mark`."""
        stream, data = self._stream, self._stream.data
        found = data.find(mark, stream.at)
        if found < 0:
            found = max(stream.at, len(data) - len(mark) + 1)
            while not mark.startswith(data[found:]):
                found += 1
        return found - stream.at

    def _skip(self, count: int) -> FrameFault | None:
        """Discard `count` bytes outside any frame; return a violation unless one was reported."""
        stream = self._stream
        first = stream.data[stream.at : stream.at + 1]
        stream.at += count
        return self._lost(
            "no-frame",
            f"no frame begins with {first.hex()}; the bytes before the next frame were skipped",
        )

    def _lost(self, code: str, message: str, *, closes: bool = False) -> FrameFault | None:
        """Return a violation; None if the current invalid bytes have already been reported."""
        if self._is_lost:
            return None
        self._is_lost = True
        return FrameFault(code, message, closes)


def frame_codec_of(spec: FramingSpec) -> FrameCodec | None:
    """Return the frame codec for `spec`; None if a frame consists only of its payload."""
    layout = cast("FrameLayout | None", spec.options.get("layout"))
    return None if layout is None or layout == FrameLayout() else FrameCodec(layout)


def encode_frame(codec: FrameCodec | None, payload: bytes, max_bytes: int) -> bytes:
    """Return `payload` as a frame; raise `FramingError` if no frame can contain the payload."""
    try:
        frame = payload if codec is None else codec.close(payload)
    except BadFrame as error:
        raise FramingError(str(error)) from None
    if len(frame) > max_bytes:
        raise FramingError(f"a frame of {len(frame)} bytes exceeds the limit of {max_bytes}")
    return frame
