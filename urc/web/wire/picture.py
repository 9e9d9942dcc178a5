"""Images and other byte values of a signal, as binary messages over a dashboard's WebSocket.

Layer 5. Pure. Each message contains one complete image; ``frames.js`` decodes it::

    0  u8   1: an image             4  u32  its age in milliseconds at the moment of encoding
    1  u8   length of the type      8  f64  the server's clock then, in milliseconds
    2  u16  index of the signal    16       media type in ASCII, then the bytes

All clients get identical bytes, so the WebSocket frame is built only once (RFC 6455, section 5.2: a
server does not mask).
"""

import struct

from urc.images import media_type

__all__ = ["as_frame", "encode_picture"]

_PICTURE = 1
_HEADER = struct.Struct(">BBHId")
_OLDEST_MS = 2**32 - 1
_FINAL_TEXT, _FINAL_BINARY = b"\x81", b"\x82"
_SHORT, _MEDIUM = 126, 1 << 16
"""Frame lengths below `_SHORT` take one byte, lengths below `_MEDIUM` take three bytes, and all
other lengths take nine bytes."""


def encode_picture(index: int, data: bytes, age_ms: int, now_ms: int) -> bytes:
    """Return the binary message with an image.

    Args:
        index: index of the signal in the names of `HelloMessage`.
        data: the image from the robot.
        age_ms: age of the image at `now_ms`, in milliseconds.
        now_ms: time on the server's clock, in milliseconds.
    """
    kind = media_type(data).encode("ascii")
    age_ms = min(max(age_ms, 0), _OLDEST_MS)
    return _HEADER.pack(_PICTURE, len(kind), index, age_ms, now_ms) + kind + data


def as_frame(message: bytes, *, is_text: bool = False) -> bytes:
    """Return a message as one WebSocket frame that any client can receive."""
    return (_FINAL_TEXT if is_text else _FINAL_BINARY) + _length(len(message)) + message


def _length(size: int) -> bytes:
    if size < _SHORT:
        return size.to_bytes(1, "big")
    if size < _MEDIUM:
        return b"\x7e" + size.to_bytes(2, "big")
    return b"\x7f" + size.to_bytes(8, "big")
