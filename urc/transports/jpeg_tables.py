"""The Huffman tables that many webcams leave out of their JPEG images.

A camera may omit the tables if they are the usual ones (USB Device Class Definition for Video
Devices, Motion-JPEG payload; ITU-T T.81, K.3). Browsers show no image without them.
"""

from collections.abc import Iterator
from fractions import Fraction
from typing import Any, Final

__all__ = ["usual_tables", "with_tables"]

_DHT, _SOS = 0xC4, 0xDA
_ALONE: Final = frozenset((0x01, *range(0xD0, 0xD9)))
"""Markers without a length field."""


def usual_tables(av: Any) -> bytes:
    """Return the segments with the usual tables, made by the library's encoder."""
    encoder = av.CodecContext.create("mjpeg", "w")
    encoder.width = encoder.height = 16
    encoder.pix_fmt, encoder.time_base = "yuvj420p", Fraction(1, 30)
    encoder.options = {"huffman": "default"}
    frame = av.VideoFrame(16, 16, "yuvj420p")
    frame.pts = 0
    data = b"".join(bytes(one) for one in [*encoder.encode(frame), *encoder.encode(None)])
    return b"".join(data[start:end] for kind, start, end in _segments(data) if kind == _DHT)


def with_tables(data: bytes, tables: bytes) -> bytes:
    """Return a JPEG file with the usual tables, unless it has tables of its own."""
    for kind, start, _ in _segments(data):
        if kind == _DHT:
            break
        if kind == _SOS:
            return data[:start] + tables + data[start:]
    return data


def _segments(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield marker, start and end of each segment up to the image's data."""
    place = 0
    while place + 4 <= len(data) and data[place] == 0xFF:
        kind = data[place + 1]
        if kind == 0xFF:  # a fill byte
            place += 1
            continue
        size = 0 if kind in _ALONE else int.from_bytes(data[place + 2 : place + 4], "big")
        yield kind, place, place + 2 + size
        if kind == _SOS:
            return
        place += 2 + size
