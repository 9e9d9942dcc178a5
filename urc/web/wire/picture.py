"""Images and other bytes of a signal, as binary messages over a dashboard's WebSocket.

Floor 5. Pure. One message is one image, never a piece of one; ``frames.js`` reads it::

    0  u8   1: a picture            4  u32  its age in milliseconds at the moment of encoding
    1  u8   length of the type      8  f64  the server's clock then, in milliseconds
    2  u16  index of the signal    16       media type in ASCII, then the bytes

The same bytes go to every client, so they are made into a WebSocket frame once as well (RFC 6455,
section 5.2: a server does not mask).
"""

import struct
from typing import Annotated

import msgspec

__all__ = ["Show", "as_frame", "encode_picture", "media_type", "picture_head"]

_PICTURE = 1
_HEADER = struct.Struct(">BBHId")
_OLDEST_MS = 2**32 - 1
_FINAL_TEXT, _FINAL_BINARY = 0x81, 0x82

_SIGNS = (
    (b"\xff\xd8\xff", "image/jpeg"),
    (b"\x89PNG\r\n\x1a\n", "image/png"),
    (b"GIF8", "image/gif"),
    (b"BM", "image/bmp"),
)
OTHER = "application/octet-stream"


class Show(msgspec.Struct, tag_field="t", tag="show", forbid_unknown_fields=True, frozen=True):
    """Says which images the page shows now; all others are not sent."""

    signals: Annotated[
        tuple[Annotated[str, msgspec.Meta(max_length=256)], ...], msgspec.Meta(max_length=64)
    ] = ()


def media_type(data: bytes) -> str:
    """Return what the bytes are, by how they begin; ``application/octet-stream`` when unknown."""
    for sign, name in _SIGNS:
        if data.startswith(sign):
            return name
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    if data[4:8] == b"ftyp" and data[8:12] in (b"avif", b"avis"):
        return "image/avif"
    return OTHER


def encode_picture(index: int, data: bytes, age_ms: int, now_ms: int) -> bytes:
    """Return one message.

    Args:
        index: of the signal in the names of `Hello`.
        data: the image as it came.
        age_ms: how old it is now.
        now_ms: the server's clock.
    """
    return _header(index, data, age_ms, now_ms) + data


def picture_head(index: int, data: bytes, age_ms: int, now_ms: int) -> tuple[bytes, int]:
    """Return what is before the image in one WebSocket frame, and where the message begins."""
    header = _header(index, data, age_ms, now_ms)
    head = _head(len(header) + len(data), _FINAL_BINARY)
    return head + header, len(head)


def _header(index: int, data: bytes, age_ms: int, now_ms: int) -> bytes:
    kind = media_type(data).encode("ascii")
    age_ms = min(max(0, age_ms), _OLDEST_MS)
    return _HEADER.pack(_PICTURE, len(kind), index, age_ms, now_ms) + kind


def as_frame(message: bytes, *, is_text: bool = False) -> bytes:
    """Return a message as one WebSocket frame, ready for any client's line."""
    return _head(len(message), _FINAL_TEXT if is_text else _FINAL_BINARY) + message


def _head(size: int, first: int) -> bytes:
    if size < 126:
        return struct.pack(">BB", first, size)
    if size < 1 << 16:
        return struct.pack(">BBH", first, 126, size)
    return struct.pack(">BBQ", first, 127, size)
