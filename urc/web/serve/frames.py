"""Finds WebSocket frames that are one whole text in one piece: what nearly every tick is.

Floor 5, pure. It only looks. Whatever is anything else (parts of frames, of messages, control
frames, what breaks the protocol) is for the library below, which reads the same bytes; here they
are counted, so that the next frame is known to begin where it begins.
"""

from typing import Final

__all__ = ["Frames", "text_of"]

_TEXT: Final = 0x81
"""First byte of a text that is not continued."""
_MASKED: Final = 0x80
_SHORT, _LONG = 126, 127
_HEAD: Final = 2
_MASK: Final = 4
_PLAIN: Final = bytes(_MASK)
"""A mask that changes nothing."""
_CONTROL: Final = 0x08


class Frames:
    """What came from one client, from the first byte after the handshake on."""

    def __init__(self) -> None:
        self._is_between = True
        """The next byte begins a frame that begins a message."""
        self._left = 0
        """Bytes of the present frame that have not come."""
        self._head = b""
        """Of a frame of whose head a part has not come."""
        self._is_inside = False
        """A message has begun and is to be continued."""
        self.spans: list[tuple[int, int]] = []
        """Of what came last and was no single text: where the texts at its beginning, each in one
        whole frame, begin and end. Each is for `text_of`."""

    def whole(self, data: bytes) -> bytes | None:
        """Return the text in `data` if that is one whole frame and nothing else, else None."""
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
    """Return the text in a whole frame of `Frames.spans`."""
    at = _HEAD + _MASK + (2 if frame[1] & 0x7F == _SHORT else 0)
    return _unmasked(frame[at - _MASK : at], frame[at:])


def _is_text(data: bytes, at: int) -> bool:
    """Return whether a text in one frame of a usual length begins there."""
    size = data[at + 1]
    return data[at] == _TEXT and bool(size & _MASKED) and size & 0x7F != _LONG


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
    size = len(data)
    key = (mask * (size // _MASK + 1))[:size]
    return (int.from_bytes(data, "big") ^ int.from_bytes(key, "big")).to_bytes(size, "big")
