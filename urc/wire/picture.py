"""The layout of a binary message that contains a signal's image or other bytes.

Layer 3½. Pure::

    0  u8   1: an image             4  u32  its age in milliseconds at the moment of encoding
    1  u8   length of the type      8  f64  the server's clock then, in milliseconds
    2  u16  index of the signal    16       media type in ASCII, then the bytes
"""

import struct
from typing import Final, NamedTuple

__all__ = ["PICTURE", "PICTURE_HEADER", "PictureMessage", "read_picture"]

PICTURE: Final = 1
"""First byte of the message, which marks its kind."""
PICTURE_HEADER: Final = struct.Struct(">BBHId")


class PictureMessage(NamedTuple):
    """The content of a binary message: a signal's bytes and their age."""

    signal_index: int
    """The signal's index in the `names` of `HelloMessage`."""
    age_ms: int
    data: bytes


def read_picture(message: bytes) -> PictureMessage | None:
    """Return the content of a binary message; None for other kinds of messages."""
    if len(message) < PICTURE_HEADER.size:
        return None
    kind, type_length, index, age_ms, _ = PICTURE_HEADER.unpack_from(message)
    if kind != PICTURE:
        return None
    return PictureMessage(index, age_ms, message[PICTURE_HEADER.size + type_length :])
