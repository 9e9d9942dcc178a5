"""The framing ``xml``: consecutive XML elements.

Theory of operation. A stream of XML elements has no root element, so each top-level element is a
frame. Tags, comments, declarations and CDATA determine the end of an element. Quoted attribute
values may contain markup characters. The scan jumps from marker to marker and reads every byte
once. Blanks, comments and declarations may separate frames. Data up to a mismatched closing tag is
dropped.
"""

import re
from typing import Final, NamedTuple, cast

from urc.model.driver import FramingSpec
from urc.protocol.framing.base import Decoder, FrameFault, FramingError, StreamDecoder
from urc.protocol.framing.receive_buffer import ReceiveBuffer

__all__ = ["XmlFraming"]

_NESTING_MOST: Final = 100
_BETWEEN: Final = b" \t\r\n"
_SPECIAL: Final = {b"<!--": b"-->", b"<![CDATA[": b"]]>", b"<?": b"?>"}
"""Last characters of comments, CDATA sections and declarations, keyed by the first characters."""
_IN_TAG: Final = re.compile(rb"[\"'<>]")
_NAME: Final = re.compile(rb"</?([^\s/<>\"'=]+)")
_WAIT, _BAD = 0, -1


class XmlFraming(NamedTuple):
    """Frames that each contain one XML element; `tx` follows each sent frame."""

    tx: bytes
    max_bytes: int
    is_reversed: bool = False

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "XmlFraming":
        """Return the framing for the option ``tx``."""
        return cls(cast("bytes", spec.options.get("tx", b"")), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        if len(payload) > self.max_bytes:
            size = len(payload)
            raise FramingError(f"a frame of {size} bytes exceeds the limit of {self.max_bytes}")
        found = _XmlDecoder(None, b"", self.max_bytes).feed(payload)
        element = found[0] if len(found) == 1 else None
        if not isinstance(element, bytes) or not payload.strip(_BETWEEN).endswith(element):
            raise FramingError(f"{payload[:80]!r} is not a single XML element")
        return payload if self.is_reversed else payload + self.tx

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        return _XmlDecoder(stream, self.tx if self.is_reversed else b"", self.max_bytes)

    def reversed(self) -> "XmlFraming":
        """Return the framing for the other end of the connection."""
        return self._replace(is_reversed=not self.is_reversed)


class _XmlDecoder(StreamDecoder):
    def __init__(self, stream: ReceiveBuffer | None, between: bytes, max_bytes: int) -> None:
        super().__init__(stream, max_bytes)
        self._blank = re.compile(b"[" + re.escape(_BETWEEN + between) + b"]*")
        self._begin()

    def restart(self) -> None:
        """Reset the state for a new frame that a `switch` assigns to the decoder."""
        super().restart()
        self._begin()

    def _begin(self) -> None:
        self._open: list[bytes] = []
        """Names of the open elements, outermost first."""
        self._looked = 0
        """Number of bytes of the current element that have been scanned."""
        self._tag = -1
        """Offset of an incomplete tag; -1 outside tags."""
        self._quote = b""
        self._until = b""
        """Terminator of the current comment, CDATA section or declaration; empty outside them."""

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        """Remove and return the next frame or violation; return None if it is incomplete."""
        stream = self._stream
        while True:
            if not self._looked:
                fault = self._to_mark()
                if fault is not None or not len(stream):
                    return fault
            end = self._to_end()
            if end > 0:
                frame = self._taken(end)
                if frame is not None:
                    return frame
                continue
            if end == _WAIT and len(stream) <= self._max_bytes:
                return None
            fault = self._drop(end == _WAIT)
            if fault is not None:
                return fault

    def _to_mark(self) -> FrameFault | None:
        """Advance to the next ``<``; return a violation for other characters between elements."""
        stream, data = self._stream, self._stream.data
        blank = self._blank.match(data, stream.at)
        if blank is not None:
            stream.at = blank.end()
        found = data.find(b"<", stream.at)
        start = len(data) if found < 0 else found
        return self._skip(start - stream.at) if start > stream.at else None

    def _to_end(self) -> int:
        """Return the end offset of the element, or of a section before it; or `_WAIT` or `_BAD`."""
        while True:
            if self._until:
                step = self._through_special()
            elif self._tag >= 0:
                step = self._through_tag()
            else:
                step = self._to_piece()
            if step <= 0:
                return step
            is_between = not (self._until or self._tag >= 0 or self._open)
            if is_between:
                return self._looked

    def _to_piece(self) -> int:
        """Find the next tag or section; return 1 if found, otherwise `_WAIT` or `_BAD`."""
        stream, data = self._stream, self._stream.data
        place = data.find(b"<", stream.at + self._looked)
        if place < 0:
            self._looked = len(stream)
            return _WAIT
        head = bytes(data[place : place + 9])
        self._looked = place - stream.at
        for begin, end in _SPECIAL.items():
            if head.startswith(begin):
                self._until = end
                self._looked += len(begin)
                return 1
        if len(head) < 9 and any(begin.startswith(head) for begin in _SPECIAL):
            return _WAIT
        self._tag = self._looked
        self._looked += 1
        return _BAD if head.startswith(b"<!") else 1

    def _through_special(self) -> int:
        stream, until = self._stream, self._until
        place = stream.data.find(until, stream.at + self._looked)
        if place < 0:
            self._looked = max(self._looked, len(stream) - len(until) + 1)
            return _WAIT
        self._looked, self._until = place + len(until) - stream.at, b""
        return 1

    def _through_tag(self) -> int:
        stream, data = self._stream, self._stream.data
        while True:
            at = stream.at + self._looked
            if self._quote:
                place = data.find(self._quote, at)
            else:
                found = _IN_TAG.search(data, at)
                place = found.start() if found else -1
            if place < 0:
                self._looked = len(stream)
                return _WAIT
            self._looked = place + 1 - stream.at
            mark = bytes(data[place : place + 1])
            if self._quote:
                self._quote = b""
            elif mark == b"<":
                self._looked -= 1
                return _BAD
            elif mark != b">":
                self._quote = mark
            else:
                return self._closed(bytes(data[stream.at + self._tag : place]))

    def _closed(self, tag: bytes) -> int:
        """Process a complete tag; return `_BAD` for an invalid tag."""
        self._tag = -1
        found = _NAME.match(tag)
        if found is None:
            return _BAD
        if tag.startswith(b"</"):
            return 1 if self._open and self._open.pop() == found[1] else _BAD
        if not tag.endswith(b"/"):
            self._open.append(found[1])
        return 1 if len(self._open) <= _NESTING_MOST else _BAD

    def _taken(self, size: int) -> bytes | FrameFault | None:
        """Remove and return the next element; return None for a comment or a declaration."""
        stream = self._stream
        piece = bytes(stream.data[stream.at : stream.at + size])
        stream.at += size
        self._begin()
        if piece.startswith((b"<!", b"<?")):
            return None
        self._is_lost = False
        if size > self._max_bytes:
            text = f"an element has {size} bytes, more than {self._max_bytes}; dropped"
            return FrameFault("frame-too-long", text)
        return piece

    def _drop(self, is_long: bool) -> FrameFault | None:
        self._stream.at += self._looked
        self._begin()
        if is_long:
            text = f"an element has more than {self._max_bytes} bytes; dropped"
            return self._lost("frame-too-long", text)
        return self._lost("bad-xml", "invalid XML tags; the data up to the error was dropped")
