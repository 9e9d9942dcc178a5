"""Framings: how a byte stream is cut into frames, and frames are made into bytes.

Floor 3, pure. Each framing owns both directions, so that the emulated robot is the same
declaration turned round (`reversed`). A decoder is bounded: a frame longer than the limit is
dropped as a whole, reported once, and the stream goes on at the next delimiter.
"""

from typing import NamedTuple, Protocol, cast

from urc.model.driver import FramingSpec
from urc.problems import UrcError
from urc.registry import Table

__all__ = ["FRAMINGS", "Decoder", "FrameFault", "Framing", "FramingError", "build_framing"]


class FramingError(UrcError):
    """A payload that this framing cannot carry."""


class FrameFault(NamedTuple):
    """Bytes that were no frame."""

    code: str
    """``frame-too-long``"""
    message: str


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

    def tick(self, now: float) -> list[bytes | FrameFault]:
        """Return the frames that the silence until `now` has completed."""


class Framing(Protocol):
    """One way of cutting, with its options."""

    def encode(self, payload: bytes) -> bytes:
        """Return the bytes of one frame; raise `FramingError` when it cannot be told apart."""

    def decoder(self) -> Decoder:
        """Return a fresh decoder."""

    def reversed(self) -> "Framing":
        """Return the same framing seen from the other end of the line."""


def build_framing(spec: FramingSpec) -> Framing:
    """Return the framing that `spec` declares."""
    framing: Framing = FRAMINGS[spec.type].load()(spec)
    return framing


class DelimiterFraming(NamedTuple):
    """Frames that end with fixed bytes; sent and received delimiters may differ."""

    tx: bytes
    rx: bytes
    max_bytes: int

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "DelimiterFraming":
        """Return the framing for options ``tx`` and ``rx``, both bytes."""
        tx, rx = cast("bytes", spec.options["tx"]), cast("bytes", spec.options["rx"])
        return cls(tx, rx, spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        if self.tx and self.tx in payload:
            raise FramingError(
                f"{payload!r} contains the delimiter {self.tx!r}: it would be two frames"
            )
        return payload + self.tx

    def decoder(self) -> Decoder:
        return _DelimiterDecoder(self.rx, self.max_bytes)

    def reversed(self) -> "DelimiterFraming":
        return self._replace(tx=self.rx, rx=self.tx)


class _DelimiterDecoder:
    """Remembers how far it has searched, so a frame that drips in costs linear time."""

    def __init__(self, delimiter: bytes, max_bytes: int) -> None:
        self._delimiter = delimiter
        self._max_bytes = max_bytes
        self._buffer = bytearray()
        self._searched = 0
        self._is_skipping = False

    @property
    def pending(self) -> int:
        return len(self._buffer)

    @property
    def deadline(self) -> float | None:
        return None

    def tick(self, now: float) -> list[bytes | FrameFault]:
        return []

    def feed(self, data: bytes, now: float = 0.0) -> list[bytes | FrameFault]:
        buffer, delimiter = self._buffer, self._delimiter
        buffer += data
        frames: list[bytes | FrameFault] = []
        start = 0
        while (end := buffer.find(delimiter, max(start, self._searched))) >= 0:
            if self._is_skipping:
                self._is_skipping = False
            elif end - start > self._max_bytes:
                frames.append(self._too_long())
            else:
                frames.append(bytes(buffer[start:end]))
            start = end + len(delimiter)
        del buffer[:start]
        if len(buffer) > self._max_bytes + len(delimiter) and not self._is_skipping:
            self._is_skipping = True
            frames.append(self._too_long())
        if self._is_skipping:
            # Only what may be the beginning of a delimiter is still of interest.
            del buffer[: max(0, len(buffer) - len(delimiter) + 1)]
        self._searched = max(0, len(buffer) - len(delimiter) + 1)
        return frames

    def _too_long(self) -> FrameFault:
        return FrameFault(
            "frame-too-long",
            f"a frame has more than {self._max_bytes} bytes without {self._delimiter!r}; dropped",
        )


FRAMINGS = Table(
    "urc.framings",
    {"delimiter": "urc.protocol.framing:DelimiterFraming.from_spec"},
)
