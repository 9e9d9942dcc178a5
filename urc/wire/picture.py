"""The layout of binary messages that contain a signal's image, other bytes, or part of a video.

Layer 3½. Pure. An image, or other bytes::

    0  u8   1: an image; 3: an      4  u32  its age in milliseconds at the moment of encoding
            image that is repeated
    1  u8   length of the type      8  f64  the server's clock then, in milliseconds
    2  u16  index of the signal    16  u32  number of the image
                                   20       media type in ASCII, then the bytes

An access unit of a video has 2 as its first byte, and the codec string in place of the media type.
Five bytes follow the common header::

   20  u16  width in pixels        24  u8   flags
   22  u16  height in pixels

The flag 1 marks a keyframe, and 2 the low stream of the camera. The flag 4 marks keyframes of a
page that receives no other images.

A page names the image that it shows by its number. The numbers of one stream are consecutive. After
a gap, the next unit is a keyframe. So is the first unit after a change between two streams.
"""

import struct
from typing import Final, NamedTuple

from urc.video import VideoUnit, encode_unit, read_unit

__all__ = [
    "KEY",
    "LOW",
    "PICTURE",
    "PICTURE_HEADER",
    "REPEATED",
    "SPARSE",
    "VIDEO",
    "VIDEO_HEADER",
    "PictureMessage",
    "read_picture",
]

PICTURE: Final = 1
"""First byte of a message with an image, which marks its kind."""
VIDEO: Final = 2
"""First byte of a message with an access unit."""
REPEATED: Final = 3
"""First byte of a message with an image that the camera repeats."""
KEY: Final = 1
"""Flag of a keyframe."""
LOW: Final = 2
"""Flag of a unit of the low stream."""
SPARSE: Final = 4
"""Flag of a keyframe on a page that receives keyframes only."""
PICTURE_HEADER: Final = struct.Struct(">BBHIdI")
VIDEO_HEADER: Final = struct.Struct(">BBHIdIHHB")


class PictureMessage(NamedTuple):
    """The content of a binary message: a signal's bytes and their age."""

    signal_index: int
    """The signal's index in the `names` of `HelloMessage`."""
    age_ms: int
    data: bytes
    """The image, other bytes, or an access unit as the value of a signal without its time."""


def read_picture(message: bytes) -> PictureMessage | None:
    """Return the content of a binary message; None for other kinds of messages."""
    if message[:1] == bytes((VIDEO,)):
        return _read_video(message)
    if len(message) < PICTURE_HEADER.size:
        return None
    kind, type_length, index, age_ms, *_ = PICTURE_HEADER.unpack_from(message)
    if kind not in (PICTURE, REPEATED):
        return None
    return PictureMessage(index, age_ms, message[PICTURE_HEADER.size + type_length :])


def _read_video(message: bytes) -> PictureMessage | None:
    if len(message) < VIDEO_HEADER.size:
        return None
    _, length, index, age_ms, _, _, width, height, flags = VIDEO_HEADER.unpack_from(message)
    start = VIDEO_HEADER.size + length
    codec = message[VIDEO_HEADER.size : start].decode("latin-1")
    if not codec.isascii() or start >= len(message):
        return None
    value = encode_unit(VideoUnit(codec, bool(flags & KEY), width, height, 0.0, message[start:]))
    return None if read_unit(value) is None else PictureMessage(index, age_ms, value)
