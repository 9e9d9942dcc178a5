"""One access unit of a video stream, as the value of a signal of type ``video``.

Pure. An access unit contains the encoded data of one image. Only a keyframe can be decoded without
the access units before it. A value is self-contained, so that recordings and the page need no other
state of the stream. Layout, in network byte order::

    0  4 bytes  "URCV"                  8  u16  height in pixels
    4  u8       1 for a keyframe       10  f64  time of arrival, monotonic, in seconds
    5  u8       length of the codec    18       codec string in ASCII, then the access unit
    6  u16      width in pixels
"""

import re
import struct
from typing import Final, NamedTuple

__all__ = ["JPEG", "MAX_UNIT_BYTES", "VideoUnit", "arrival_s", "encode_unit", "read_unit"]
__all__ += ["with_time"]

MAX_UNIT_BYTES: Final = 4_194_304
"""Maximum size of an access unit, in bytes; a keyframe of a 4K camera has about 1 MB."""

JPEG: Final = "jpeg"
"""Codec of a unit that is a JPEG file, from a camera of this computer."""
_SIGN: Final = b"URCV"
_HEADER: Final = struct.Struct(">4sBBHHd")
_TIME: Final = struct.Struct(">d")
_LATE_S: Final = 60.0
"""Longest credible time between arrival and reading of a unit, in seconds. A unit may contain the
arrival time of another computer."""
_CODEC: Final = re.compile(rb"[A-Za-z0-9.]{3,40}")


class VideoUnit(NamedTuple):
    """An access unit with the properties that a decoder needs."""

    codec: str
    """Codec string of RFC 6381, such as ``avc1.42E01E``; `JPEG` for a JPEG file."""
    is_key: bool
    """Whether decoding can start with this access unit."""
    width: int
    height: int
    time_s: float
    """Monotonic time at which the access unit reached this machine, in seconds."""
    data: bytes
    """The access unit with start codes; a keyframe contains its parameter sets."""


def encode_unit(unit: VideoUnit) -> bytes:
    """Return an access unit as the value of a signal."""
    codec = unit.codec.encode("ascii")
    head = _HEADER.pack(_SIGN, unit.is_key, len(codec), unit.width, unit.height, unit.time_s)
    return head + codec + unit.data


def with_time(value: bytes, time_s: float) -> bytes:
    """Return an access unit in a signal's value with another time of arrival."""
    place = _HEADER.size - _TIME.size
    return value[:place] + _TIME.pack(time_s) + value[_HEADER.size :]


def arrival_s(unit: VideoUnit, time_s: float) -> float:
    """Return when a unit reached this computer, also if the server was held up afterwards.

    Args:
        unit: the access unit.
        time_s: time of its reading, in monotonic seconds.
    """
    return unit.time_s if 0 <= time_s - unit.time_s <= _LATE_S else time_s


def read_unit(value: bytes) -> VideoUnit | None:
    """Return the access unit in a signal's value; None for any other bytes."""
    if len(value) <= _HEADER.size or not value.startswith(_SIGN):
        return None
    _, is_key, length, width, height, time_s = _HEADER.unpack_from(value)
    start = _HEADER.size + length
    codec = value[_HEADER.size : start]
    if start >= len(value) or not _CODEC.fullmatch(codec) or time_s != time_s:
        return None
    return VideoUnit(codec.decode("ascii"), is_key == 1, width, height, time_s, value[start:])
