"""Finds WebSocket frames that are one whole text in one piece: what nearly every tick is.

Floor 5, pure. It only looks. Whatever is anything else (parts of frames, of messages, control
frames, what breaks the protocol) is for the library below, which reads the same bytes; here they
are counted, so that the next frame is known to begin where it begins.
"""

from typing import Final

__all__ = ["Frames"]

_TEXT: Final = 0x81
"""First byte of a text that is not continued."""
_MASKED: Final = 0x80
_SHORT, _LONG = 126, 127
_HEAD: Final = 2
_MASK: Final = 4
_CONTROL: Final = 0x08


class Frames:
    """What came from one client, from the first byte after the handshake on."""

    def __init__(self) -> None:
        self._left = 0
        """Bytes of the present frame that have not come."""
        self._head = b""
        """Of a frame of whose head a part has not come."""
        self._is_inside = False
        """A message has begun and is to be continued."""

    def whole(self, data: bytes) -> bytes | None:
        """Return the text in `data` if that is one whole frame and nothing else, else None."""
        if self._left or self._head or self._is_inside:
            self._walk(data)
            return None
        if len(data) < _HEAD + _MASK or data[0] != _TEXT or not data[1] & _MASKED:
            self._walk(data)
            return None
        size, at = data[1] & 0x7F, _HEAD
        if size == _SHORT:
            size, at = int.from_bytes(data[2:4], "big"), _HEAD + 2
        if size == _LONG or len(data) != at + _MASK + size:
            self._walk(data)
            return None
        return _unmasked(data[at : at + _MASK], data[at + _MASK :])

    def _walk(self, data: bytes) -> None:
        data, self._head = self._head + data, b""
        at = 0
        while at < len(data):
            skipped = min(self._left, len(data) - at)
            at += skipped
            self._left -= skipped
            if at == len(data):
                return
            size = _size(data, at)
            if size is None:
                self._head = data[at:]
                return
            first = data[at]
            if not first & _CONTROL:
                self._is_inside = not first & 0x80
            self._left = size


def _size(data: bytes, at: int) -> int | None:
    """Return the bytes of the frame that begins at `at`, its head included; None: not known yet."""
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
    if mask == b"\0\0\0\0":
        return data
    size = len(data)
    key = (mask * (size // _MASK + 1))[:size]
    return (int.from_bytes(data, "big") ^ int.from_bytes(key, "big")).to_bytes(size, "big")
