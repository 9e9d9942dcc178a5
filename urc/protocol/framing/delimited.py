"""The framing ``delimiter``: frames that end with a delimiter."""

from typing import NamedTuple, cast

from urc.model.driver import FramingSpec
from urc.protocol.framing.base import (
    Decoder,
    FrameFault,
    FramingError,
    Open,
    StreamDecoder,
    encode_frame,
    frame_codec_of,
)
from urc.protocol.framing.frame import BadFrame, FrameCodec
from urc.protocol.framing.receive_buffer import ReceiveBuffer, RescanBudget

__all__ = ["DelimiterDecoder", "DelimiterFraming"]


class DelimiterFraming(NamedTuple):
    """Frames that end with a delimiter; sent and received frames may have different delimiters."""

    tx: bytes
    rx: bytes
    max_bytes: int
    codec: FrameCodec | None = None

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "DelimiterFraming":
        """Return the framing for the options ``tx`` and ``rx``, both of type bytes."""
        tx, rx = cast("bytes", spec.options["tx"]), cast("bytes", spec.options["rx"])
        return cls(tx, rx, spec.max_bytes, frame_codec_of(spec))

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        frame = payload if self.codec is None else encode_frame(self.codec, payload, self.max_bytes)
        if self.tx and self.tx in frame:
            raise FramingError(
                f"{payload!r} contains the delimiter {self.tx!r}, so it would be sent as two frames"
            )
        return frame + self.tx

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        return DelimiterDecoder(
            stream, self.rx, self.max_bytes, None if self.codec is None else self.codec.open
        )

    def reversed(self) -> "DelimiterFraming":
        """Return the framing for the other end of the connection."""
        return self._replace(tx=self.rx, rx=self.tx)


class DelimiterDecoder(StreamDecoder):
    """A decoder for delimited frames, in linear time even if the bytes arrive one at a time.

    A frame over the size limit is dropped and reported once. After a dropped frame, decoding
    continues at the next delimiter.
    """

    def __init__(
        self,
        stream: ReceiveBuffer | None,
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
        """Number of scanned bytes that contain no delimiter."""
        self._is_skipping = False
        self._credit: RescanBudget | None = None
        """Rescan budget if the decoder reads a case of a `switch`; otherwise None. In a `switch`,
        only the first byte of a frame over the size limit is dropped."""

    def restart(self) -> None:
        """Reset the state for a new frame that a `switch` assigns to the decoder."""
        super().restart()
        self._searched = 0
        self._credit = self._credit or RescanBudget()

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Remove and return the next frame or violation; return None if it is incomplete."""
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

    def ahead(self) -> list[bytes]:
        """If several complete frames are buffered, return them without removing them.

        The returned list is empty if any frame requires a check or exceeds the size limit. `skip`
        removes processed frames from the stream.
        """
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
        """Remove the first `count` frames from `ahead`; together, they have `size` bytes."""
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

    def _wait(self, credit: RescanBudget | None) -> FrameFault | None:
        """Keep an incomplete frame's bytes; return a violation if they exceed the size limit."""
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
            # Only a partial delimiter needs to be kept.
            stream.at = max(stream.at, len(stream.data) - keep)
        self._searched = max(0, len(stream) - keep)
        return fault

    def _too_long(self) -> FrameFault:
        return FrameFault(
            "frame-too-long",
            f"a frame has more than {self._max_bytes} bytes without {self._delimiter!r}; dropped",
        )
