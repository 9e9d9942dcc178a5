"""Framings: how a byte stream is cut into frames, and frames are made into bytes.

Floor 3, pure. Each framing owns both directions, so that the emulated robot is the same
declaration turned round (`reversed`). This module has what all framings share, and the simplest
one; the others are in `urc.protocol.framings`.

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
from urc.protocol.stream import Credit, Stream
from urc.registry import Table

__all__ = [
    "FRAMINGS",
    "Credit",
    "Decoder",
    "DelimiterDecoder",
    "FrameFault",
    "SKIPPED",
    "Framing",
    "FramingError",
    "Open",
    "Stream",
    "StreamDecoder",
    "build_framing",
    "sealed",
    "seal_of",
]


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

    def whole(self, data: bytes) -> bytes | None:
        """Return the payload of `data`, if it is one good frame and nothing is held back.

        That is as good as `push` and `next` with it; None leaves it to them.
        """

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


def build_framing(spec: FramingSpec) -> Framing:
    """Return the framing that `spec` declares."""
    framing: Framing = FRAMINGS[spec.type].load()(spec)
    if spec.timeout_s is not None or spec.strips_ansi:
        from urc.protocol.framings.patient import PatientFraming

        framing = PatientFraming(framing, spec.timeout_s, spec.strips_ansi)
    if spec.sent is None:
        return framing
    from urc.protocol.framings.paired import TwoFramings

    return TwoFramings(build_framing(spec.sent), framing)


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

    def whole(self, data: bytes) -> bytes | None:
        """Return the payload of a single frame, or None: `next` finds out."""
        return None

    def ahead(self) -> list[bytes]:
        """Return whole frames that there are, if several, and leave them where they are.

        Nothing where each must be looked at by itself; `skip` takes those that were used.
        """
        return []

    def skip(self, count: int, size: int) -> None:
        """Take the first `count` frames of `ahead`, whose payloads have `size` bytes in all."""

    def restart(self) -> None:
        """Forget what was seen of the stream: one case of a `switch` has a frame begin here."""
        self._is_lost = False
        self._is_case = True

    def _refused(self, error: BadFrame) -> FrameFault | None:
        """Return the fault of a frame that was cut, or None when nobody wants to know of it."""
        if error.code == SKIPPED and not self._is_case:
            return None
        return FrameFault(error.code, str(error), error.closes)

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


SKIPPED: Final = ""
"""Code of a frame that is to be dropped without a word; only a `switch` sees it."""
Open = Callable[[bytes], bytes]


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


class DelimiterFraming(NamedTuple):
    """Frames that end with fixed bytes; sent and received delimiters may differ."""

    tx: bytes
    rx: bytes
    max_bytes: int
    seal: Seal | None = None

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "Framing":
        """Return the framing for options ``tx`` and ``rx``, both bytes."""
        if "escape" in spec.options:
            from urc.protocol.framings.escaped import EscapedFraming

            return EscapedFraming.from_spec(spec)
        tx, rx = cast("bytes", spec.options["tx"]), cast("bytes", spec.options["rx"])
        return cls(tx, rx, spec.max_bytes, seal_of(spec))

    def encode(self, payload: bytes) -> bytes:
        frame = payload if self.seal is None else sealed(self.seal, payload, self.max_bytes)
        if self.tx and self.tx in frame:
            raise FramingError(
                f"{payload!r} contains the delimiter {self.tx!r}: it would be two frames"
            )
        return frame + self.tx

    def decoder(self, stream: Stream | None = None) -> Decoder:
        return DelimiterDecoder(
            stream, self.rx, self.max_bytes, None if self.seal is None else self.seal.open
        )

    def reversed(self) -> "DelimiterFraming":
        return self._replace(tx=self.rx, rx=self.tx)


class DelimiterDecoder(StreamDecoder):
    """Remembers how far it has searched, so a frame that drips in costs linear time.

    A frame that is too long is dropped as a whole, reported once, and the stream goes on behind the
    next delimiter.
    """

    def __init__(
        self,
        stream: Stream | None,
        delimiter: bytes,
        max_bytes: int,
        opened: Open | None = None,
        *,
        skips_empty: bool = False,
    ) -> None:
        super().__init__(stream, max_bytes)
        self._delimiter = delimiter
        self._open = opened
        self._skips_empty = skips_empty
        self._searched = 0
        """How many bytes of the stream are known to have no delimiter."""
        self._is_skipping = False
        self._credit: Credit | None = None
        """Of a case of a `switch`: there a frame that is too long costs its first byte only."""

    def restart(self) -> None:
        """Let a frame of a `switch` begin here."""
        super().restart()
        self._searched = 0
        self._credit = self._credit or Credit()

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Return one frame or fault, or None when there is none yet."""
        stream, delimiter = self._stream, self._delimiter
        while stream.at < len(stream.data):
            start = stream.at
            most = len(stream.data)
            if self._credit is not None:
                most = min(most, start + self._max_bytes + len(delimiter))
            end = stream.data.find(delimiter, start + self._searched, most)
            if end < 0:
                return self._wait(self._credit)
            stream.at = end + len(delimiter)
            self._searched = 0
            if self._credit is not None:
                self._credit.earn(stream.at - start)
            if self._is_skipping:
                self._is_skipping = False
            elif end - start > self._max_bytes:
                return self._too_long()
            elif end > start or not self._skips_empty:
                frame = self._opened(bytes(stream.data[start:end]))
                if frame is not None:
                    return frame
        return None

    def whole(self, data: bytes) -> bytes | None:
        """Return the payload of a single frame, unless it needs a closer look."""
        stream, end = self._stream, data.find(self._delimiter)
        if end + len(self._delimiter) != len(data) or not 0 <= end <= self._max_bytes:
            return None
        if stream.at != len(stream.data) or self._credit or self._is_skipping:
            return None
        if self._open is None:
            return data[:end] if end or not self._skips_empty else None
        try:
            return self._open(data[:end])
        except BadFrame:
            return None  # it is told by `next`

    def ahead(self) -> list[bytes]:
        """Return whole frames, unless they are unwrapped, skipped or too long."""
        stream, delimiter = self._stream, self._delimiter
        if self._open or self._credit or self._is_skipping or self._skips_empty:
            return []
        first = stream.data.find(delimiter, stream.at + self._searched)
        if first < 0 or stream.data.find(delimiter, first + len(delimiter)) < 0:
            return []
        frames = bytes(memoryview(stream.data)[stream.at :]).split(delimiter)
        frames.pop()
        return frames if max(map(len, frames)) <= self._max_bytes else []

    def skip(self, count: int, size: int) -> None:
        """Take frames, and the delimiters behind them."""
        if count:
            self._stream.at += size + count * len(self._delimiter)
            self._searched = 0

    def _opened(self, frame: bytes) -> bytes | FrameFault | None:
        if self._open is None:
            return frame
        try:
            return self._open(frame)
        except BadFrame as error:
            return self._refused(error)

    def _wait(self, credit: Credit | None) -> FrameFault | None:
        """Keep what may yet become a frame."""
        stream, keep = self._stream, len(self._delimiter) - 1
        fault = None
        if credit is not None and len(stream) >= self._max_bytes + len(self._delimiter):
            stream.at += 1 if credit.spend(self._max_bytes) else self._max_bytes
            self._searched = 0
            return self._too_long()
        if len(stream) > self._max_bytes + len(self._delimiter) and not self._is_skipping:
            self._is_skipping = True
            fault = self._too_long()
        if self._is_skipping:
            # Only what may be the beginning of a delimiter is still of interest.
            stream.at = max(stream.at, len(stream.data) - keep)
        self._searched = max(0, len(stream) - keep)
        return fault

    def _too_long(self) -> FrameFault:
        return FrameFault(
            "frame-too-long",
            f"a frame has more than {self._max_bytes} bytes without {self._delimiter!r}; dropped",
        )


FRAMINGS = Table(
    "urc.framings",
    {
        "delimiter": "urc.protocol.framing:DelimiterFraming.from_spec",
        "fixed": "urc.protocol.framings.measured:MeasuredFraming.from_spec",
        "length": "urc.protocol.framings.measured:MeasuredFraming.from_spec",
        "slip": "urc.protocol.framings.stuffed:SlipFraming.from_spec",
        "cobs": "urc.protocol.framings.stuffed:CobsFraming.from_spec",
        "idle": "urc.protocol.framings.silent:IdleFraming.from_spec",
        "datagram": "urc.protocol.framings.silent:DatagramFraming.from_spec",
        "regex": "urc.protocol.framings.searched:RegexFraming.from_spec",
        "brackets": "urc.protocol.framings.searched:BracketsFraming.from_spec",
        "json": "urc.protocol.framings.json_values:JsonFraming.from_spec",
        "switch": "urc.protocol.framings.switched:SwitchFraming.from_spec",
    },
)
