"""The framing ``json``: consecutive JSON objects or arrays.

Theory of operation. The end of a value is found from brackets and quotes alone. A regular
expression finds the brackets and quotes, so every byte is scanned once. Blanks, line endings and
the record separator of RFC 7464 may separate two values. After mismatched brackets or a control
character inside a string, all data up to the error is dropped.
"""

import re
from typing import Final, NamedTuple, cast

from urc.model.driver import FramingSpec
from urc.protocol.framing.base import (
    Decoder,
    FrameFault,
    FramingError,
    StreamDecoder,
    encode_frame,
    frame_codec_of,
)
from urc.protocol.framing.frame import BadFrame, FrameCodec
from urc.protocol.framing.receive_buffer import ReceiveBuffer

__all__ = ["JsonFraming"]

_NESTING_MOST: Final = 256
_BETWEEN: Final = b" \t\r\n\x1e"
_OPENER: Final = re.compile(rb"[{\[]")
_MARK: Final = re.compile(rb'[{}\[\]"]')
_IN_STRING: Final = re.compile(rb'["\\\x00-\x1f]')
_CLOSES: Final = {ord("{"): ord("}"), ord("["): ord("]")}
_QUOTE, _BACKSLASH = ord('"'), ord("\\")


class JsonFraming(NamedTuple):
    """Frames that each contain one JSON object or array; `tx` follows each sent frame."""

    tx: bytes
    codec: FrameCodec | None
    max_bytes: int
    is_reversed: bool = False

    @classmethod
    def from_spec(cls, spec: FramingSpec) -> "JsonFraming":
        """Return the framing for the option ``tx``."""
        return cls(cast("bytes", spec.options.get("tx", b"")), frame_codec_of(spec), spec.max_bytes)

    def encode(self, payload: bytes) -> bytes:
        """Return `payload` as a frame in wire form; raise `FramingError` if impossible."""
        frame = encode_frame(self.codec, payload, self.max_bytes)
        if _JsonDecoder(None, b"", None, self.max_bytes).feed(frame) != [frame.strip(_BETWEEN)]:
            raise FramingError(f"{payload[:80]!r} is not a single JSON object or array")
        return frame if self.is_reversed else frame + self.tx

    def decoder(self, stream: ReceiveBuffer | None = None) -> Decoder:
        """Return a new decoder for received bytes."""
        between = self.tx if self.is_reversed else b""
        return _JsonDecoder(stream, between, self.codec, self.max_bytes)

    def reversed(self) -> "JsonFraming":
        """Return the framing for the other end of the connection."""
        return self._replace(is_reversed=not self.is_reversed)


class _JsonDecoder(StreamDecoder):
    def __init__(
        self, stream: ReceiveBuffer | None, between: bytes, codec: FrameCodec | None, max_bytes: int
    ) -> None:
        super().__init__(stream, max_bytes)
        self._codec = codec
        self._blank = re.compile(b"[" + re.escape(_BETWEEN + between) + b"]*")
        self.restart()

    def restart(self) -> None:
        super().restart()
        self._open: list[int] = []
        """Closing brackets that are still missing, in the order of the opening brackets."""
        self._is_in_string = False
        self._looked = 0
        """Number of bytes of the current value that have been scanned."""

    def next(self, now: float = 0.0) -> bytes | FrameFault | None:
        stream = self._stream
        while True:
            if not self._open:
                fault = self._to_value()
                if fault is not None or not self._open:
                    return fault
            end = self._to_end()
            if end > 0:
                return self._frame(end)
            if end == 0 and len(stream) <= self._max_bytes:
                return None
            fault = self._drop(end == 0)
            if fault is not None:
                return fault

    def _to_value(self) -> FrameFault | None:
        """Advance to the next opening bracket."""
        stream, data = self._stream, self._stream.data
        blank = self._blank.match(data, stream.at)
        if blank is not None:
            stream.at = blank.end()
        found = _OPENER.search(data, stream.at)
        start = found.start() if found else len(data)
        fault = self._skip(start - stream.at) if start > stream.at else None
        if found:
            self._open.append(_CLOSES[data[start]])
            self._looked = 1
        return fault

    def _to_end(self) -> int:
        """Return the size of the JSON value in bytes; 0 if incomplete, -1 if invalid."""
        stream, data, stack = self._stream, self._stream.data, self._open
        while True:
            pattern = _IN_STRING if self._is_in_string else _MARK
            found = pattern.search(data, stream.at + self._looked)
            if found is None:
                self._looked = len(stream)
                return 0
            place, mark = found.start(), data[found.start()]
            if self._is_in_string and mark == _BACKSLASH:
                if place + 1 == len(data):
                    self._looked = place - stream.at
                    return 0
                place += 1
            elif mark == _QUOTE:
                self._is_in_string = not self._is_in_string
            elif mark in _CLOSES:
                stack.append(_CLOSES[mark])
            self._looked = place + 1 - stream.at
            if mark in (_QUOTE, _BACKSLASH):
                continue
            if mark not in _CLOSES and (self._is_in_string or stack.pop() != mark):
                return -1
            if not stack:
                return self._looked
            if len(stack) > _NESTING_MOST:
                return -1

    def _frame(self, size: int) -> bytes | FrameFault:
        stream = self._stream
        frame = bytes(stream.data[stream.at : stream.at + size])
        stream.at += size
        self.restart()
        if size > self._max_bytes:
            text = f"a JSON value has {size} bytes, more than {self._max_bytes}; dropped"
            return FrameFault("frame-too-long", text)
        try:
            return frame if self._codec is None else self._codec.open(frame)
        except BadFrame as error:
            return FrameFault(error.code, str(error), error.closes)

    def _drop(self, is_long: bool) -> FrameFault | None:
        self._stream.at += self._looked
        self._open, self._is_in_string, self._looked = [], False, 0
        if is_long:
            text = f"a JSON value has more than {self._max_bytes} bytes; dropped"
            return self._lost("frame-too-long", text)
        return self._lost(
            "bad-json", "invalid JSON brackets or quotes; the data up to the error was dropped"
        )
