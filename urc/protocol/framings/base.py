"""What a framing is, and what all framings share.

Floor 3, pure. Each framing owns both directions, so that the emulated robot is the same
declaration turned round (`reversed`).

Theory of operation. A decoder takes frames off the front of a `Stream`, one a call, and leaves the
rest there: so another decoder may go on with it when a reply brings its own framing. It is bounded:
what is held back never outgrows the longest frame. It is linear: what it has looked at, it does not
look at again, or only as often as `Credit` allows. After bytes that are no frame it says so once,
and goes on where the next frame may begin.
"""

from collections.abc import Callable
from typing import Final, NamedTuple, Protocol, cast

from urc.model.driver import FramingSpec
from urc.model.framing import FrameLayout
from urc.problems import UrcError
from urc.protocol.frame import BadFrame, Seal
from urc.protocol.stream import Stream

__all__ = [
    "SKIPPED",
    "Decoder",
    "FrameFault",
    "Framing",
    "FramingError",
    "Open",
    "StreamDecoder",
    "seal_of",
    "sealed",
]

SKIPPED: Final = ""
"""Code of a frame that is to be dropped without a word; only a `switch` sees it."""
Open = Callable[[bytes], bytes]


class FramingError(UrcError):
    """A payload that this framing cannot carry."""


class FrameFault(NamedTuple):
    """Bytes that were no frame."""

    code: str
    """``frame-too-long``, ``bad-checksum``, ``no-frame`` …"""
    message: str
    closes: bool = False
    """Whether the connection is to be given up."""


class Decoder(Protocol):
    """Cuts one stream. Made anew for each connection, so nothing stale survives."""

    @property
    def pending(self) -> int:
        """Bytes held back because their frame is not complete."""

    @property
    def deadline(self) -> float | None:
        """When `tick` may complete a frame by silence alone; None when only bytes can."""

    def feed(self, data: bytes, now: float = 0.0) -> list[bytes | FrameFault]:
        """Take bytes and return the frames that are now complete, in order."""

    def push(self, data: bytes, now: float = 0.0) -> None:
        """Take bytes, to be cut by `next`."""

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Return one frame or fault and take it off the stream; None when none is complete."""

    def tick(self, now: float) -> list[bytes | FrameFault]:
        """Return the frames that the silence until `now` has completed."""


class Framing(Protocol):
    """One way of cutting, with its options."""

    def encode(self, payload: bytes) -> bytes:
        """Return the bytes of one frame; raise `FramingError` when it cannot be told apart."""

    def decoder(self, stream: Stream | None = None) -> Decoder:
        """Return a fresh decoder, of what is in `stream` already and what will be fed."""

    def reversed(self) -> "Framing":
        """Return the same framing seen from the other end of the line."""


class StreamDecoder:
    """What the decoders share. One of them adds `next`."""

    def __init__(self, stream: Stream | None, max_bytes: int) -> None:
        self._stream = Stream() if stream is None else stream
        self._max_bytes = max_bytes
        self._is_lost = False
        """Whether the bytes since the last frame were none: that is told once."""
        self._is_case = False
        """Whether a `switch` chooses anew behind each frame."""

    @property
    def pending(self) -> int:
        """Bytes held back."""
        return len(self._stream)

    @property
    def deadline(self) -> float | None:
        """None: only bytes complete a frame."""
        return None

    def push(self, data: bytes, now: float = 0.0) -> None:
        """Take bytes, to be cut by `next`."""
        self._stream.push(data)

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Return one frame or fault, or None when there is none yet."""
        raise NotImplementedError

    def feed(self, data: bytes, now: float = 0.0) -> list[bytes | FrameFault]:
        """Take bytes and return the frames that are now complete, in order."""
        self.push(data, now)
        frames: list[bytes | FrameFault] = []
        while (frame := self.next(now)) is not None:
            frames.append(frame)
        return frames

    def tick(self, now: float) -> list[bytes | FrameFault]:
        """Return the frames that silence has completed: none."""
        return []

    def restart(self) -> None:
        """Forget what was seen of the stream: one case of a `switch` has a frame begin here."""
        self._is_lost = False
        self._is_case = True

    def _refused(self, error: BadFrame) -> FrameFault | None:
        """Return the fault of a frame that was cut, or None when nobody wants to know of it."""
        if error.code == SKIPPED and not self._is_case:
            return None
        return FrameFault(error.code, str(error), error.closes)

    def _before(self, mark: bytes) -> int:
        """Return how many bytes stand before the next `mark`, or before what may become one."""
        stream, data = self._stream, self._stream.data
        found = data.find(mark, stream.at)
        if found < 0:
            found = max(stream.at, len(data) - len(mark) + 1)
            while not mark.startswith(data[found:]):
                found += 1
        return found - stream.at

    def _skip(self, count: int) -> FrameFault | None:
        """Let go of bytes that begin no frame; return a fault for the first of their run."""
        stream = self._stream
        first = stream.data[stream.at : stream.at + 1]
        stream.at += count
        return self._lost(
            "no-frame", f"bytes from {first.hex()} on begin no frame; skipped up to the next one"
        )

    def _lost(self, code: str, message: str, *, closes: bool = False) -> FrameFault | None:
        """Return a fault, or None when the run of bytes that are no frame is told already."""
        if self._is_lost:
            return None
        self._is_lost = True
        return FrameFault(code, message, closes)


def seal_of(spec: FramingSpec) -> Seal | None:
    """Return what wraps the payloads of `spec`, or None when they are the frames themselves."""
    layout = cast("FrameLayout | None", spec.options.get("layout"))
    return None if layout is None or layout == FrameLayout() else Seal(layout)


def sealed(seal: Seal | None, payload: bytes, max_bytes: int) -> bytes:
    """Return the frame around `payload`; raise `FramingError` when it cannot be one."""
    try:
        frame = payload if seal is None else seal.close(payload)
    except BadFrame as error:
        raise FramingError(str(error)) from None
    if len(frame) > max_bytes:
        raise FramingError(f"a frame of {len(frame)} bytes is longer than {max_bytes}")
    return frame
