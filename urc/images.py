"""Media type and size of an image, read from its first bytes without decoding.

A small image file may need gigabytes of memory in a browser, so the size in pixels matters, not the
file size. Sources: PNG (ISO/IEC 15948, 11.2.2), JPEG (ITU-T T.81, B.2.2), GIF89a (section 18), WebP
(RFC 9649), BMP (BITMAPINFOHEADER).
"""

import struct
from typing import Final

__all__ = ["MAX_PIXELS", "media_type", "picture_size", "pixels"]

MAX_PIXELS: Final = 16_000_000
"""Maximum number of pixels in an image. An image of this size takes 64 MB of memory in a
browser."""

_OTHER: Final = "application/octet-stream"
_SIGNS: Final = (
    (b"\xff\xd8\xff", "image/jpeg"),
    (b"\x89PNG\r\n\x1a\n", "image/png"),
    (b"GIF8", "image/gif"),
    (b"BM", "image/bmp"),
)
_SIZE_MARKERS: Final = frozenset((*range(0xC0, 0xD0),)) - {0xC4, 0xC8, 0xCC}
"""JPEG start-of-frame markers (SOF): all markers 0xC0 to 0xCF except for DHT, JPG and DAC."""
_ALONE: Final = frozenset((0x01, *range(0xD0, 0xD9)))
"""JPEG markers without a length field."""


def media_type(data: bytes) -> str:
    """Return the media type of an image; ``application/octet-stream`` if unknown."""
    for sign, name in _SIGNS:
        if data.startswith(sign):
            return name
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    if data[4:8] == b"ftyp" and data[8:12] in (b"avif", b"avis"):
        return "image/avif"
    return _OTHER


def picture_size(data: bytes) -> tuple[int, int] | None:
    """Return the width and height of an image in pixels; None if the size is unknown.

    The result for AVIF is always None, because AVIF stores the size in nested boxes. Browsers limit
    the size of AVIF images themselves.
    """
    read = _READERS.get(media_type(data))
    try:
        return None if read is None else read(data)
    except (struct.error, IndexError):
        return None  # truncated, so no browser can decode the image


def pixels(data: bytes) -> int:
    """Return the number of pixels in an image; 0 if the size is unknown."""
    width, height = picture_size(data) or (0, 0)
    return width * height


def _png(data: bytes) -> tuple[int, int]:
    width, height = struct.unpack_from(">II", data, 16)
    return width, height


def _gif(data: bytes) -> tuple[int, int]:
    width, height = struct.unpack_from("<HH", data, 6)
    return width, height


def _bmp(data: bytes) -> tuple[int, int]:
    width, height = struct.unpack_from("<ii", data, 18)
    return abs(width), abs(height)


def _webp(data: bytes) -> tuple[int, int] | None:
    kind = data[12:16]
    if kind == b"VP8X":  # width - 1 and height - 1, 24 bits each
        width, height = data[24:27], data[27:30]
        return int.from_bytes(width, "little") + 1, int.from_bytes(height, "little") + 1
    if kind == b"VP8L":  # after one byte: width - 1 and height - 1, 14 bits each
        (bits,) = struct.unpack_from("<I", data, 21)
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 ":  # after the frame tag and the start code
        width, height = struct.unpack_from("<HH", data, 26)
        return width & 0x3FFF, height & 0x3FFF
    return None


def _jpeg(data: bytes) -> tuple[int, int] | None:
    place = 2
    while place + 4 <= len(data):
        if data[place] != 0xFF:
            return None
        marker = data[place + 1]
        if marker == 0xFF:  # a fill byte
            place += 1
        elif marker in _ALONE:
            place += 2
        elif marker in _SIZE_MARKERS:
            height, width = struct.unpack_from(">HH", data, place + 5)
            return width, height
        else:
            (length,) = struct.unpack_from(">H", data, place + 2)
            place += 2 + max(2, length)
    return None


_READERS: Final = {
    "image/jpeg": _jpeg,
    "image/png": _png,
    "image/gif": _gif,
    "image/bmp": _bmp,
    "image/webp": _webp,
}
