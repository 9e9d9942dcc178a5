"""Images, videos and other byte values, as binary messages over a dashboard's WebSocket.

Layer 5. Pure. Each message contains one complete image or one access unit. `urc.wire.picture`
defines the layout, and ``frames.js`` decodes the messages.

All clients receive identical bytes, so the WebSocket frame is built only once. According to RFC
6455, section 5.2, a server does not mask frames.
"""

from urc.images import media_type
from urc.video import VideoUnit
from urc.wire.picture import (
    KEY,
    LOW,
    PICTURE,
    PICTURE_HEADER,
    REPEATED,
    SPARSE,
    VIDEO,
    VIDEO_HEADER,
)

__all__ = [
    "FIRST_LOW",
    "NUMBERS",
    "as_frame",
    "encode_picture",
    "encode_video",
    "message_of",
]

_OLDEST_MS = 2**32 - 1
NUMBERS = 2**32
"""Number of different image numbers; later images repeat them."""
FIRST_LOW = 2**31
"""Number before the first access unit of a low stream, so that both streams differ."""
_FINAL_TEXT, _FINAL_BINARY = b"\x81", b"\x82"
_SHORT, _MEDIUM = 126, 1 << 16
"""Frame lengths below `_SHORT` need one byte, lengths below `_MEDIUM` need three bytes, and all
other lengths need nine bytes."""


def encode_picture(
    index: int, data: bytes, number: int, age_ms: int, now_ms: int, *, is_repeated: bool = False
) -> bytes:
    """Return the binary message with an image.

    Args:
        index: index of the signal in the `names` of `HelloMessage`.
        data: the robot's image.
        number: number of the image, by which a page names it.
        age_ms: age of the image at `now_ms`, in milliseconds.
        now_ms: time on the server's clock, in milliseconds.
        is_repeated: whether the camera repeats the image.
    """
    kind = media_type(data).encode("ascii")
    age_ms = min(max(age_ms, 0), _OLDEST_MS)
    number %= NUMBERS
    first = REPEATED if is_repeated else PICTURE
    return PICTURE_HEADER.pack(first, len(kind), index, age_ms, now_ms, number) + kind + data


def encode_video(
    index: int,
    unit: VideoUnit,
    number: int,
    age_ms: int,
    now_ms: int,
    *,
    is_low: bool = False,
    is_sparse: bool = False,
) -> bytes:
    """Return the binary message with an access unit.

    Args:
        index: index of the signal in the `names` of `HelloMessage`.
        unit: the access unit.
        number: number of the unit within its signal.
        age_ms: age of the unit at `now_ms`, in milliseconds.
        now_ms: time on the server's clock, in milliseconds.
        is_low: whether the unit belongs to the low stream of the camera.
        is_sparse: whether the page receives keyframes only.
    """
    codec = unit.codec.encode("ascii")
    head = VIDEO_HEADER.pack(
        *(VIDEO, len(codec), index, min(max(age_ms, 0), _OLDEST_MS), now_ms),
        *(number % NUMBERS, unit.width, unit.height),
        KEY * unit.is_key | LOW * is_low | SPARSE * is_sparse,
    )
    return head + codec + unit.data


def as_frame(message: bytes, *, is_text: bool = False) -> bytes:
    """Return a message as one WebSocket frame for any client."""
    return (_FINAL_TEXT if is_text else _FINAL_BINARY) + _length(len(message)) + message


def message_of(frame: bytes) -> memoryview:
    """Return the message in a WebSocket frame from `as_frame`, without a copy."""
    wide = {_SHORT: 2, _SHORT + 1: 8}.get(frame[1], 0)
    return memoryview(frame)[2 + wide :]


def _length(size: int) -> bytes:
    if size < _SHORT:
        return size.to_bytes(1, "big")
    if size < _MEDIUM:
        return b"\x7e" + size.to_bytes(2, "big")
    return b"\x7f" + size.to_bytes(8, "big")
