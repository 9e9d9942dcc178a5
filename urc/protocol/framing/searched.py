"""The framings ``regex`` and ``brackets``, which search for frames in the stream."""

import re
from collections.abc import Callable
from typing import Any, Final, NamedTuple, cast

from urc.model.driver import FramingSpec
from urc.model.framing import FrameLayout
from urc.protocol.framing.base import (
    Decoder,
    FrameFault,
    Framing,
    FramingError,
    Open,
    StreamDecoder,
    encode_frame,
    frame_codec_of,
)
from urc.protocol.framing.delimited import DelimiterDecoder
from urc.protocol.framing.frame import BadFrame, FrameCodec
from urc.protocol.framing.receive_buffer import ReceiveBuffer

__all__ = ["BracketsDecoder", "BracketsFraming", "RegexFraming"]

Search = Callable[[bytes | bytearray, int], Any]
"""Search function that returns the next `re` or RE2 match after a start offset, or None."""

_SMALL: Final = 256
"""Maximum size of a buffer that is searched each time bytes arrive, in bytes."""
_GROWTH: Final = 8
"""A larger buffer is searched again after growing by 1 / `_GROWTH` of its size."""
_QUIET_S: Final = 0.005
"""Silence after which a larger buffer is searched regardless of its growth, in seconds."""


class RegexFraming(NamedTuple):
    """A framing whose received frames are the matches of a pattern.

    If `tx` is declared, every sent frame ends with `tx` and need not match the pattern.
    """

    search: Search
    tx: bytes
    codec: FrameCodec | None
    max_bytes: int
    is_reversed: bool = False

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "RegexFraming":
        """Return the framing for the options ``pattern`` (its text) and ``tx`` (bytes)."""
        search = _searcher(cast("str", spec.options["pattern"]))
        tx = cast("bytes", spec.options.get("tx", b""))
        return cls(search, tx, frame_codec_of(spec), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        frame = encode_frame(self.codec, payload, self.max_bytes)
        if self.tx and not self.is_reversed:
            if self.tx in frame:
                raise FramingError(
                    f"{payload!r} contains {self.tx!r}, so it would be sent as two frames"
                )
            return frame + self.tx
        found = self.search(frame, 0)
        if found is None or found.span() != (0, len(frame)):
            raise FramingError(f"{payload!r} does not match the pattern of the framing")
        return frame

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        if self.tx and self.is_reversed:
            opened = None if self.codec is None else self.codec.open
            return DelimiterDecoder(stream, self.tx, self.max_bytes, opened)
        return _RegexDecoder(stream, self.search, self.codec, self.max_bytes)

    def reversed(self) -> "RegexFraming":
        """Return the framing for the other end of the connection."""
        return self._replace(is_reversed=not self.is_reversed)


def _searcher(pattern: str) -> Search:
    """Return a search function over bytes for a Latin-1 pattern."""
    source = pattern.removeprefix("^").encode("latin-1")
    try:
        import re2
    except ImportError:
        # The loader accepts only patterns that take linear time at each start position.
        compiled: Search = re.compile(source).search
        return compiled
    options = re2.Options()
    options.log_errors = False
    options.max_mem = 1 << 20  # the limit for all patterns
    options.encoding = re2.Options.Encoding.LATIN1
    searched: Search = re2.compile(source, options).search
    return searched


class _RegexDecoder(StreamDecoder):
    def __init__(
        self, stream: ReceiveBuffer | None, search: Search, codec: FrameCodec | None, max_bytes: int
    ) -> None:
        super().__init__(stream, max_bytes)
        self._search = search
        self._codec = codec
        self._tried = 0
        """Number of bytes already searched without a match."""
        self._newest = 0.0

    @property
    def deadline(self) -> float | None:
        return self._newest + _QUIET_S if len(self._stream) > self._tried else None

    def restart(self) -> None:
        super().restart()
        self._tried = 0

    def push(self, data: bytes, now: float = 0.0) -> None:
        super().push(data, now)
        self._newest = now

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        there = len(self._stream)
        is_due = there > self._tried and (
            there <= _SMALL or there >= self._tried + self._tried // _GROWTH
        )
        return self._find() if is_due else None

    def tick(self, now: float) -> list[bytes | FrameFault]:
        frames: list[bytes | FrameFault] = []
        if len(self._stream) <= self._tried or now < self._newest + _QUIET_S:
            return frames
        while (frame := self._find()) is not None:
            frames.append(frame)
        return frames

    def _find(self) -> bytes | FrameFault | None:
        stream = self._stream
        while len(stream) > self._tried:
            found = self._search(stream.data, stream.at)
            if found is None:
                return self._wait()
            start, stop = found.span()
            self._tried = 0
            if start > stream.at:
                fault = self._skip(start - stream.at)
                if fault is not None:
                    return fault
            frame = bytes(stream.data[start:stop])
            stream.at = stop
            if len(frame) > self._max_bytes:
                text = f"a frame has {len(frame)} bytes, more than {self._max_bytes}; dropped"
                return FrameFault("frame-too-long", text)
            self._is_lost = False
            try:
                return frame if self._codec is None else self._codec.open(frame)
            except BadFrame as error:
                fault = self._refused(error)
            if fault is not None:
                return fault
        return None

    def _wait(self) -> FrameFault | None:
        """Keep the newest bytes up to the frame size limit, because a frame may begin in them."""
        fault = None
        surplus = len(self._stream) - self._max_bytes
        if surplus > 0:
            fault = self._skip(surplus)
        self._tried = len(self._stream)
        return fault


class BracketsFraming(NamedTuple):
    """Frames between an opening and a closing marker. The markers are not part of the payload.

    Frames are not nested: a second opening marker restarts the frame.
    """

    codec: FrameCodec
    max_bytes: int

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> Framing:
        """Return the framing for the option ``layout``, which has start and end markers."""
        return cls(frame_codec_of(spec) or FrameCodec(FrameLayout()), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        frame = encode_frame(self.codec, payload, self.max_bytes)
        layout = self.codec.layout
        inner = frame[len(layout.start) : len(frame) - len(layout.end)]
        for mark in (layout.start, layout.end):
            if mark in inner:
                raise FramingError(f"{payload!r} contains {mark!r}, a marker of the framing")
        if layout.start == layout.end and not inner:
            raise FramingError("an empty frame cannot be sent between two equal markers")
        return frame

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        layout = self.codec.layout
        return BracketsDecoder(stream, layout.start, layout.end, self.codec.open, self.max_bytes)

    def reversed(self) -> "BracketsFraming":
        """Return the framing for the other end of the connection."""
        return self


class BracketsDecoder(StreamDecoder):
    """A linear-time decoder for frames between two markers."""

    def __init__(
        self, stream: ReceiveBuffer | None, start: bytes, end: bytes, opened: Open, max_bytes: int
    ) -> None:
        super().__init__(stream, max_bytes)
        self._opened = opened
        self._open, self._close = start, end
        self._searched = 0
        """Number of scanned bytes without a closing marker; 0 before the opening marker."""

    def restart(self) -> None:
        """Reset the state for a new frame that a `switch` assigns to the decoder."""
        super().restart()
        self._searched = 0

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Remove and return the next frame or violation; return None if it is incomplete."""
        stream, data = self._stream, self._stream.data
        while True:
            if not self._searched:
                fault = self._to_open()
                if fault is not None or not self._searched:
                    return fault
            close = data.find(self._close, stream.at + self._searched)
            if close < 0:
                self._searched = max(len(self._open), len(stream) - len(self._close) + 1)
                if len(stream) <= self._max_bytes:
                    return None
                fault = self._overflow()
            else:
                # Another opening marker: the end of the previous frame is missing.
                last = data.rfind(self._open, stream.at + len(self._open), close)
                if last < 0:
                    frame = self._frame(close)
                    if frame is not None:
                        return frame
                    continue
                fault = self._skip(last - stream.at)
                self._searched = max(len(self._open), close - last)
            if fault is not None:
                return fault

    def _to_open(self) -> FrameFault | None:
        gone = self._before(self._open)
        if len(self._stream) >= gone + len(self._open):
            self._searched = len(self._open)
        return self._skip(gone) if gone else None

    def _overflow(self) -> FrameFault | None:
        """Continue at the newest opening marker; the frame before it exceeds the size limit."""
        stream = self._stream
        fault = self._too_long()
        last = stream.data.rfind(self._open, stream.at + len(self._open))
        gone = last - stream.at if last >= 0 else 1
        stream.at += gone
        self._searched = max(len(self._open), self._searched - gone) if last >= 0 else 0
        return fault

    def _too_long(self) -> FrameFault | None:
        text = f"a frame has more than {self._max_bytes} bytes without {self._close!r}; dropped"
        return self._lost("frame-too-long", text)

    def _frame(self, close: int) -> bytes | FrameFault | None:
        """Remove and return the frame that ends at `close`; return None for an empty frame."""
        stream = self._stream
        stop = close + len(self._close)
        if self._open == self._close and close == stream.at + len(self._open):
            # Two adjacent equal markers: the second one opens a frame.
            stream.at = close
            self._searched = len(self._open)
            return None
        frame = bytes(stream.data[stream.at : stop])
        stream.at = stop
        self._searched = 0
        if len(frame) > self._max_bytes:
            return self._too_long()
        self._is_lost = False
        try:
            return self._opened(frame)
        except BadFrame as error:
            return self._refused(error)
