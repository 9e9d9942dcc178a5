"""The image of an emulated camera without a world: one colour, which changes slowly.

Pure, and without Pillow. Each block of the JPEG image has only a mean.
"""

import colorsys
from typing import Final

__all__ = ["picture"]

_BLOCKS: Final = (20, 15)
"""Columns and rows of 8 by 8 pixel blocks in an image of 160 by 120 pixels."""
_PERIOD_S: Final = 12.0
"""Period of the colour cycle, in seconds."""


def picture(now_s: float) -> bytes:
    """Return a JPEG image for the time `now_s`, in seconds."""
    red, green, blue = colorsys.hsv_to_rgb(now_s / _PERIOD_S % 1.0, 0.6, 0.9)
    luma = 0.299 * red + 0.587 * green + 0.114 * blue
    means = (luma - 0.5, 0.564 * (blue - luma), 0.713 * (red - luma))
    bits = "".join(_mean(round(255 * mean)) + _REST_IS_EVEN for mean in means)
    bits += ("0000" + _REST_IS_EVEN) * 3 * (_BLOCKS[0] * _BLOCKS[1] - 1)
    bits += "1" * (-len(bits) % 8)
    data = int(bits, 2).to_bytes(len(bits) // 8, "big").replace(b"\xff", b"\xff\x00")
    return _HEAD + data + b"\xff\xd9"


def _mean(difference: int) -> str:
    """Return the JPEG code of a difference between block means: bit count (four bits) and value."""
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
    # All quantisers are 8, so a block's mean is encoded unchanged.
    + _segment(0xDB, b"\0" + b"\x08" * 64)
    + _segment(0xC0, b"\x08" + _SIZE + b"\x03\x01\x11\0\x02\x11\0\x03\x11\0")
    # The lengths 0 to 11 as four-bit codes, and "nothing else in this block" as one bit.
    + _segment(0xC4, b"\0" + b"\0\0\0\x0c" + b"\0" * 12 + bytes(range(12)))
    + _segment(0xC4, b"\x10" + b"\x01" + b"\0" * 15 + b"\0")
    + _segment(0xDA, b"\x03\x01\0\x02\0\x03\0\0\x3f\0")
)
