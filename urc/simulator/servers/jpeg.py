"""Images of an emulated camera: one changing colour, as baseline JPEG (ITU T.81).

An image of one colour needs no JPEG arithmetic: each block consists of its mean alone, and every
mean after the first is written as "unchanged".
"""

import colorsys
from typing import Final

__all__ = ["picture"]

_BLOCKS: Final = (20, 15)
"""Columns and rows of 8 by 8 points: 160 by 120 points."""
_PERIOD_S: Final = 12.0
"""Time in which the colour goes once round."""


def picture(now_s: float) -> bytes:
    """Return the picture of the time `now_s`, in seconds."""
    red, green, blue = colorsys.hsv_to_rgb(now_s / _PERIOD_S % 1.0, 0.6, 0.9)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    means = (luma - 0.5, 0.564 * (blue - luma), 0.713 * (red - luma))
    bits = "".join(_mean(round(255 * mean)) + _REST_IS_EVEN for mean in means)
    bits += ("0000" + _REST_IS_EVEN) * 3 * (_BLOCKS[0] * _BLOCKS[1] - 1)
    bits += "1" * (-len(bits) % 8)
    data = int(bits, 2).to_bytes(len(bits) // 8, "big").replace(b"\xff", b"\xff\x00")
    return _HEAD + data + b"\xff\xd9"


def _mean(difference: int) -> str:
    """Return a difference from the mean before: four bits of its length, and itself."""
    if difference == 0:
        return "0000"
    length = abs(difference).bit_length()
    shown = difference if difference > 0 else difference + (1 << length) - 1
    return f"{length:04b}{shown:0{length}b}"


def _segment(marker: int, data: bytes) -> bytes:
    return bytes((0xFF, marker)) + (len(data) + 2).to_bytes(2, "big") + data


_REST_IS_EVEN: Final = "0"
_SIZE: Final = (8 * _BLOCKS[1]).to_bytes(2, "big") + (8 * _BLOCKS[0]).to_bytes(2, "big")
_HEAD: Final = (
    b"\xff\xd8"
    + _segment(0xE0, b"JFIF\0\x01\x01\0\0\x01\0\x01\0\0")
    # Quantised by 8 everywhere: the mean of a block is then written as it is.
    + _segment(0xDB, b"\0" + b"\x08" * 64)
    + _segment(0xC0, b"\x08" + _SIZE + b"\x03\x01\x11\0\x02\x11\0\x03\x11\0")
    # The lengths 0 to 11 as codes of four bits, and "nothing else in this block" as one bit.
    + _segment(0xC4, b"\0" + b"\0\0\0\x0c" + b"\0" * 12 + bytes(range(12)))
    + _segment(0xC4, b"\x10" + b"\x01" + b"\0" * 15 + b"\0")
    + _segment(0xDA, b"\x03\x01\0\x02\0\x03\0\0\x3f\0")
)
