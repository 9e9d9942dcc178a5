"""The framings ``fixed`` and ``length``: frames of fixed size or with a length field.

Theory of operation. If the framing has start bytes, the decoder advances to the next start bytes;
otherwise, every byte may begin a frame. If the length, the end bytes or the checksum is wrong, only
the first byte is dropped. A valid frame may begin at the second byte of an invalid frame. The
checksum may therefore be computed several times over the same bytes, so `RescanBudget` limits
rescanning. After the budget is spent, the whole invalid frame is dropped.
"""

from typing import NamedTuple

from urc.model.driver import FramingSpec
from urc.model.framing import FrameLayout
from urc.protocol.framing.base import (
    SKIPPED,
    Decoder,
    FrameFault,
    Framing,
    StreamDecoder,
    encode_frame,
    frame_codec_of,
)
from urc.protocol.framing.frame import BadFrame, FrameCodec
from urc.protocol.framing.receive_buffer import ReceiveBuffer, RescanBudget

__all__ = ["LengthFraming"]


class LengthFraming(NamedTuple):
    """Frames of fixed size or with a length field; both directions use the same layout."""

    codec: FrameCodec
    max_bytes: int

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> Framing:
        """Return the framing for the option ``layout``."""
        return cls(frame_codec_of(spec) or FrameCodec(FrameLayout()), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        return encode_frame(self.codec, payload, self.max_bytes)

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        return _MeasuredDecoder(stream, self.codec, self.max_bytes)

    def reversed(self) -> "LengthFraming":
        """Return the framing for the other end of the connection."""
        return self


class _MeasuredDecoder(StreamDecoder):
    def __init__(self, stream: ReceiveBuffer | None, codec: FrameCodec, max_bytes: int) -> None:
        super().__init__(stream, max_bytes)
        layout = codec.layout
        self._codec = codec
        self._start, self._end = layout.start, layout.end
        self._size, self._length = layout.size, codec.length
        self._header = self._length.end if self._length else 0
        parts = (layout.head + layout.tail, self._header + layout.tail, len(layout.start))
        self._least = max(*parts, 1)
        self._credit = RescanBudget()
        size = self._size or 0
        self._plain = (
            0 if self._start or self._end or not self._least <= size <= max_bytes else size
        )
        """Fixed frame size in bytes if frames need no check; otherwise 0."""

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        stream, data = self._stream, self._stream.data
        if self._plain:
            end = stream.at + self._plain
            if len(data) < end:
                return None
            try:
                payload = self._codec.open(bytes(data[stream.at : end]))
            except BadFrame:
                pass  # reported below
            else:
                stream.at, self._is_lost = end, False
                self._credit.earn(self._plain)
                return payload
        while True:
            fault = self._to_start()
            if fault is not None:
                return fault
            at, there = stream.at, len(stream)
            if there < len(self._start) or there < self._header or not there:
                return None
            size = self._size or (self._length.total(data, at) if self._length else 0)
            if size is None:
                return self._endless(there)
            if not self._least <= size <= self._max_bytes:
                fault = self._bad_length(size)
            elif there < size:
                return None
            elif not data.startswith(self._end, at + size - len(self._end)):
                fault = self._leave(1)
            else:
                frame = self._frame(bytes(data[at : at + size]))
                if frame is not None:
                    return frame
            if fault is not None:
                return fault

    def _to_start(self) -> FrameFault | None:
        """Advance to the next start bytes, or to partial start bytes at the end of the buffer."""
        stream, start = self._stream, self._start
        if not start or stream.data.startswith(start, stream.at):
            return None
        gone = self._before(start)
        return self._leave(gone) if gone else None

    def _frame(self, frame: bytes) -> bytes | FrameFault | None:
        """Return the payload or a violation; None for a violation that was already reported."""
        try:
            payload = self._codec.open(frame)
        except BadFrame as error:
            if error.code == SKIPPED:
                self._move(len(frame))
                return self._refused(error)
            affordable = self._credit.spend(len(frame))
            self._move(1 if affordable else len(frame))
            return self._lost(error.code, str(error), closes=error.closes)
        self._move(len(frame))
        self._is_lost = False
        return payload

    def _leave(self, count: int) -> FrameFault | None:
        self._credit.earn(count)
        return self._skip(count)

    def _move(self, count: int) -> None:
        self._credit.earn(count)
        self._stream.at += count

    def _endless(self, there: int) -> FrameFault | None:
        """Return None while more bytes may complete the length field, otherwise a violation."""
        return self._bad_length(there) if there >= self._max_bytes else None

    def _bad_length(self, size: int) -> FrameFault | None:
        self._move(1)
        if size > self._max_bytes:
            text = f"a frame claims {size} bytes, more than the limit of {self._max_bytes}"
            return self._lost("frame-too-long", text)
        return self._lost("bad-length", "a frame has an invalid length field; skipped")
