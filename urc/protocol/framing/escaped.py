"""Framings that apply byte stuffing to the whole content between two markers.

Theory of operation. Markers (start, end, delimiter) are sent unchanged. Byte stuffing is the last
step of encoding, so the length field and the checksum refer to the original bytes. If every marker
byte in the content is escaped, the decoder finds markers by an ordinary search. If a marker begins
with the escape byte and the content contains doubled escape bytes, the decoder processes all
escapes in order. A frame with a length field is decoded byte by byte, until it has the stated
length.
"""

from functools import partial
from typing import NamedTuple, cast

from urc.model.driver import FramingSpec
from urc.model.framing import EscapeSpec, FrameLayout
from urc.protocol.framing.base import (
    SKIPPED,
    Decoder,
    FrameFault,
    FramingError,
    Open,
    StreamDecoder,
    encode_frame,
)
from urc.protocol.framing.delimited import DelimiterDecoder
from urc.protocol.framing.frame import BadFrame, FrameCodec, LengthField
from urc.protocol.framing.receive_buffer import ReceiveBuffer, RescanBudget
from urc.protocol.framing.searched import BracketsDecoder
from urc.protocol.framing.stuffing import Stuffing, Unstuffer

__all__ = ["EscapedFraming"]


class EscapedFraming(NamedTuple):
    """Frames with a start marker, stuffed content and an end marker."""

    codec: FrameCodec
    stuffing: Stuffing
    tx: bytes
    rx: bytes
    max_bytes: int

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "EscapedFraming":
        """Return the framing for the options ``escape`` and ``layout``, or ``tx`` and ``rx``."""
        layout = cast("FrameLayout", spec.options.get("layout", FrameLayout()))
        tx = cast("bytes", spec.options.get("tx", layout.end))
        rx = cast("bytes", spec.options.get("rx", layout.end))
        escape = cast("EscapeSpec", spec.options["escape"])
        return cls(FrameCodec(layout), Stuffing(escape), tx, rx, spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        frame = encode_frame(self.codec, payload, self.max_bytes)
        start, end = self.codec.layout.start, self.codec.layout.end
        inner = frame[len(start) : len(frame) - len(end)]
        if not inner:
            raise FramingError("an empty frame cannot be sent between two markers")
        content = self.stuffing.stuff(inner)
        if self.stuffing.spec.after and self.codec.length is None and self.tx in content:
            raise FramingError(f"{payload!r} contains the end marker {self.tx!r}")
        is_bare = self.stuffing.is_doubled and start == self.stuffing.escape
        if is_bare and inner[:1] in (start, end[1:]):
            raise FramingError(f"{payload!r} would look like a marker after {start.hex()}")
        return start + content + self.tx

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        layout = self.codec.layout
        if isinstance(self.codec.length, LengthField):
            return _LengthDecoder(stream, self, self.codec.length)
        if self.stuffing.is_doubled and self.stuffing.escape in layout.start[:1] + self.rx[:1]:
            return _DoubledDecoder(stream, self)
        most = 2 * self.max_bytes
        if not layout.start or layout.start == self.rx:
            # One marker may end a frame and begin the next.
            return DelimiterDecoder(stream, self.rx, most, self.opened, skips_empty=True)
        marked = partial(self.opened_between, layout.start, layout.end)
        return BracketsDecoder(stream, layout.start, layout.end, marked, most)

    def reversed(self) -> "EscapedFraming":
        """Return the framing for the other end of the connection."""
        return self._replace(tx=self.rx, rx=self.tx)

    def opened(self, content: bytes) -> bytes:
        """Return the payload from the content between the markers; raise `BadFrame` if invalid."""
        layout = self.codec.layout
        frame = layout.start + self.stuffing.unstuff(content) + layout.end
        if len(frame) > self.max_bytes:
            text = f"a frame has more than {self.max_bytes} bytes; dropped"
            raise BadFrame("frame-too-long", text)
        return self.codec.open(frame)

    def opened_between(self, start: bytes, end: bytes, frame: bytes) -> bytes:
        """Return the payload from a frame with its markers; raise `BadFrame` if invalid."""
        return self.opened(frame[len(start) : len(frame) - len(end)])


class _DoubledDecoder(StreamDecoder):
    """A decoder for frames that end with an escape sequence such as DLE ETX."""

    def __init__(self, stream: ReceiveBuffer | None, framing: EscapedFraming) -> None:
        super().__init__(stream, 2 * framing.max_bytes)
        self._open: Open = framing.opened
        self._start, self._end = framing.codec.layout.start, framing.rx
        self._escape = framing.stuffing.escape
        self._searched = -1
        """Number of the frame's bytes already scanned for the end marker; -1 before a frame
        starts."""

    def restart(self) -> None:
        super().restart()
        self._searched = -1

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        while True:
            if self._searched < 0:
                fault = self._to_start()
                if fault is not None or self._searched < 0:
                    return fault
            found = self._to_end()
            if found is not None or self._searched >= 0:
                return found

    def _to_start(self) -> FrameFault | None:
        """Advance to the next start marker, skipping doubled escape bytes and end markers."""
        stream, start = self._stream, self._start
        if not start:
            self._searched = 0 if len(stream) else -1
            return None
        place = stream.at
        while True:
            found = stream.data.find(start[:1], place)
            if found < 0:
                place = len(stream.data)
                break
            place = found
            there = bytes(stream.data[found : found + max(len(start), len(self._end), 2)])
            if len(start) == 1 == len(there) or (
                len(there) < len(start) and start.startswith(there)
            ):
                break
            is_end = there.startswith(self._end)
            is_doubled = there[:2] == self._escape * 2
            if there.startswith(start) and not is_end and not is_doubled:
                self._searched = len(start)
                break
            place += len(self._end) if is_end else 2 if is_doubled else 1
        return self._skip(place - stream.at) if place > stream.at else None

    def _to_end(self) -> bytes | FrameFault | None:
        """Return a frame, a violation or None; after None with `_searched` at -1, call again."""
        stream, data, end = self._stream, self._stream.data, self._end
        while True:
            place = data.find(self._escape, stream.at + self._searched)
            there = bytes(data[place : place + max(len(end), 2)]) if place >= 0 else b""
            if place < 0 or (len(there) < len(end) and end.startswith(there)) or len(there) < 2:
                self._searched = (place if place >= 0 else len(data)) - stream.at
                return self._too_long() if len(stream) > self._max_bytes else None
            if there[:2] == self._escape * 2:
                self._searched = place + 2 - stream.at
            elif there.startswith(end):
                return self._frame(place)
            else:
                # An invalid escape: the end of the frame that began here is missing.
                gone = place - stream.at if self._start else place + 2 - stream.at
                self._searched = -1
                return self._skip(gone)

    def _frame(self, end: int) -> bytes | FrameFault | None:
        stream = self._stream
        content = bytes(stream.data[stream.at + len(self._start) : end])
        stream.at = end + len(self._end)
        self._searched = -1
        try:
            payload = self._open(content)
        except BadFrame as error:
            return self._refused(error)
        self._is_lost = False
        return payload

    def _too_long(self) -> FrameFault | None:
        self._stream.at = len(self._stream.data)
        self._searched = -1
        text = f"a frame has more than {self._max_bytes} bytes without an end marker; dropped"
        return self._lost("frame-too-long", text)


class _LengthDecoder(StreamDecoder):
    """A decoder for frames whose length field counts the original bytes, before stuffing."""

    def __init__(
        self, stream: ReceiveBuffer | None, framing: EscapedFraming, length: LengthField
    ) -> None:
        super().__init__(stream, framing.max_bytes)
        self._codec, self._stuffing, self._length = framing.codec, framing.stuffing, length
        layout = framing.codec.layout
        self._start, self._end = layout.start, layout.end
        self._least = max(layout.head + layout.tail, length.end + layout.tail, 1)
        self._credit = RescanBudget()
        self._begin()

    def _begin(self) -> None:
        self._plain = Unstuffer(self._stuffing)
        self._total = 0
        """Size of the frame in bytes; 0 before the length field is decoded."""
        self._taken = len(self._start)
        """Number of wire bytes processed since the start of the frame."""

    def restart(self) -> None:
        super().restart()
        self._begin()

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        stream = self._stream
        while len(stream):
            fault = self._to_start()
            if fault is not None:
                return fault
            if len(stream) < len(self._start):
                return None
            verdict = self._read()
            if verdict is None:
                return None
            if verdict:
                found: bytes | FrameFault | None = self._leave(*verdict)
            else:
                found = self._frame()
            if found is not None:
                return found
        return None

    def _read(self) -> tuple[str, ...] | None:
        """Process bytes; return () if complete, None if incomplete, or an error's code and text."""
        stream, plain, start = self._stream, self._plain, self._start
        inner = len(start)
        while True:
            size = inner + len(plain.plain)
            if not self._total and size >= self._length.end:
                self._total = self._length.total(start + plain.plain[: self._length.end - inner], 0)
                if not self._least <= self._total <= self._max_bytes:
                    return "bad-length", "a frame has an invalid length field; skipped"
            if self._total and size >= self._total - len(self._end) and not plain.is_between:
                return self._ending()
            if self._taken >= len(stream):
                return None
            byte = stream.data[stream.at + self._taken]
            self._taken += 1
            is_mark = start[:1] == bytes((byte,)) and byte in self._stuffing.spec.table
            if is_mark or not plain.feed(byte):
                return "bad-stuffing", "a frame has invalid byte stuffing; skipped"

    def _ending(self) -> tuple[str, ...] | None:
        """Check the end bytes; return a result in the same form as `_read`."""
        at = self._stream.at + self._taken
        there = bytes(self._stream.data[at : at + len(self._end)])
        if there == self._end:
            return ()
        return None if self._end.startswith(there) else ("no-frame", "wrong end bytes; skipped")

    def _to_start(self) -> FrameFault | None:
        """Advance to the next start bytes, or to partial start bytes at the end of the buffer."""
        gone = self._before(self._start)
        self._credit.earn(gone)
        return self._skip(gone) if gone else None

    def _frame(self) -> bytes | FrameFault | None:
        """Decode and return the payload of the complete frame."""
        size = self._taken + len(self._end)
        try:
            payload = self._codec.open(self._start + bytes(self._plain.plain) + self._end)
        except BadFrame as error:
            if error.code == SKIPPED:
                self._move(size)
                return self._refused(error)
            return self._leave(error.code, str(error), closes=error.closes)
        self._move(size)
        self._is_lost = False
        return payload

    def _move(self, count: int) -> None:
        self._credit.earn(count)
        self._stream.at += count
        self._begin()

    def _leave(self, code: str, text: str, *, closes: bool = False) -> FrameFault | None:
        """Continue after the first byte of an invalid frame if the budget allows rescanning."""
        self._move(1 if self._credit.spend(self._taken) else max(1, self._taken))
        return self._lost(code, text, closes=closes)
