"""A parser for WebSocket frames that each contain a complete text message, such as most ticks.

Layer 5, pure. The parser reads the bytes without changing them. The WebSocket library processes
everything else in the same bytes: fragments, control frames and protocol errors. For other frames,
this module only counts the bytes, to find the start of the next frame.
"""

from typing import Final

__all__ = ["WebSocketFrames", "text_of"]

_TEXT: Final = 0x81
"""First byte of an unfragmented text frame."""
_MASKED: Final = 0x80
_SHORT, _LONG = 126, 127
_HEAD: Final = 2
_MASK: Final = 4
_PLAIN: Final = bytes(_MASK)
"""Masking key that leaves the payload unchanged."""
_CONTROL: Final = 0x08


class WebSocketFrames:
    """Parser for the bytes received from one client after the handshake."""

    def __init__(self) -> None:
        self._is_between = True
        """Whether the next byte starts a new message."""
        self._left = 0
        """Number of bytes of the current frame that have not arrived yet."""
        self._head = b""
        """Received bytes of an incomplete frame header."""
        self._is_inside = False
        """Whether a fragmented message is incomplete."""
        self.spans: list[tuple[int, int]] = []
        """Start and end of each complete text frame at the beginning of the last received bytes,
        for `text_of`. Empty if the bytes were a single text frame."""

    def whole(self, data: bytes) -> bytes | None:
        """Return the text if `data` is exactly one complete text frame; otherwise None."""
        size = len(data)
        if self._is_between and size >= _HEAD + _MASK and data[0] == _TEXT and data[1] & _MASKED:
            at, said = _HEAD + _MASK, data[1] & 0x7F
            if said == _SHORT:
                at, said = at + 2, data[2] << 8 | data[3]
            if size == at + said and said != _LONG:
                mask = data[at - _MASK : at]
                return data[at:] if mask == _PLAIN else _unmasked(mask, data[at:])
        self._walk(data)
        return None

    def _walk(self, data: bytes) -> None:
        self.spans = spans = []
        is_leading = self._is_between
        data, self._head = self._head + data, b""
        at = 0
        while at < len(data):
            skipped = min(self._left, len(data) - at)
            at += skipped
            self._left -= skipped
            if at == len(data):
                break
            size = _size(data, at)
            if size is None:
                self._head = data[at:]
                break
            first = data[at]
            if not first & _CONTROL:
                self._is_inside = not first & 0x80
            self._left = size
            is_leading = is_leading and at + size <= len(data) and _is_text(data, at)
            if is_leading:
                spans.append((at, at + size))
        self._is_between = not (self._left or self._head or self._is_inside)


def text_of(frame: bytes) -> bytes:
    """Return the text of a complete frame from `WebSocketFrames.spans`."""
    at = _HEAD + _MASK + (2 if frame[1] & 0x7F == _SHORT else 0)
    return _unmasked(frame[at - _MASK : at], frame[at:])


def _is_text(data: bytes, at: int) -> bool:
    """Return whether a complete text frame with a length of at most 16 bits begins at `at`."""
    size = data[at + 1]
    return data[at] == _TEXT and bool(size & _MASKED) and size & 0x7F != _LONG


def _size(data: bytes, at: int) -> int | None:
    """Return the size of the frame at `at` and its header, in bytes; None if not yet known."""
    if len(data) < at + _HEAD:
        return None
    size, head = data[at + 1] & 0x7F, _HEAD
    wide = {_SHORT: 2, _LONG: 8}.get(size, 0)
    if wide:
        head += wide
        if len(data) < at + head:
            return None
        size = int.from_bytes(data[at + _HEAD : at + head], "big")
    return head + (_MASK if data[at + 1] & _MASKED else 0) + size


def _unmasked(mask: bytes, data: bytes) -> bytes:
    size = len(data)
    key = (mask * (size // _MASK + 1))[:size]
    return (int.from_bytes(data, "big") ^ int.from_bytes(key, "big")).to_bytes(size, "big")
