"""The videos of a recording, whose messages become access units again.

Layer 4. Pure. A message contains one access unit (``foxglove.CompressedVideo``). Without the access
units before it, an access unit cannot be decoded, so everything starts with a keyframe.
"""

from collections.abc import Mapping
from typing import Any, Final, Generic, TypeVar

import msgspec

from urc._h264 import is_keyframe
from urc.protocol.values.video_message import VideoConverter
from urc.video import with_time

__all__ = ["GROUP_BYTES", "GROUP_UNITS", "Group", "RecordedUnit", "RecordedVideos", "recorded_unit"]

GROUP_UNITS: Final = 1500
"""Maximum number of access units that a jump passes on, as in the feed of the pages."""
GROUP_BYTES: Final = 16_777_216
_HEVC: Final = "h265"
_SIGN: Final = b'"h26'
_FORMATS: Final = frozenset(("h264", _HEVC))
_SECOND_NS: Final = 1_000_000_000
_T = TypeVar("_T")


class _Stamp(msgspec.Struct):
    sec: int
    nsec: int


class RecordedUnit(msgspec.Struct):
    """One access unit in a recording."""

    data: bytes
    """The access unit with start codes."""
    format: str
    """``h264`` or ``h265``."""
    timestamp: _Stamp

    @property
    def is_hevc(self) -> bool:
        """Whether the video is H.265 instead of H.264."""
        return self.format == _HEVC

    @property
    def is_key(self) -> bool:
        """Whether decoding can start with this access unit."""
        return is_keyframe(self.data, is_hevc=self.is_hevc)

    @property
    def time_ns(self) -> int:
        """Time of arrival of the access unit, in nanoseconds since 1970."""
        return self.timestamp.sec * _SECOND_NS + self.timestamp.nsec


_decoder: Final = msgspec.json.Decoder(RecordedUnit)


def recorded_unit(data: bytes) -> RecordedUnit | None:
    """Return the access unit in a message of a signal; None for any other message."""
    if _SIGN not in data:
        return None
    try:
        found = _decoder.decode(data)
    except (msgspec.DecodeError, msgspec.ValidationError):
        return None
    return found if found.format in _FORMATS else None


class Group(Generic[_T]):
    """The items that belong to the newest group of pictures of one video."""

    def __init__(self) -> None:
        self.items: list[_T] = []
        """Items from a keyframe on; empty before the first keyframe and after an overflow."""
        self._bytes = 0

    def add(self, item: _T, unit: RecordedUnit) -> None:
        """Add the next access unit; units after an overflow are left out until a keyframe."""
        if unit.is_key:
            self.items.clear()
            self._bytes = 0
        elif not self.items:
            return
        self._bytes += len(unit.data)
        if self._bytes > GROUP_BYTES or len(self.items) >= GROUP_UNITS:
            self.items.clear()
            return
        self.items.append(item)


class RecordedVideos:
    """The converters of all videos of one playback."""

    def __init__(self) -> None:
        """Begin without access units."""
        self._converters: dict[str, VideoConverter] = {}

    def value(self, signal: str, told: Mapping[str, Any], time_s: float) -> bytes:
        """Return the access unit of a message as the value of its signal.

        Args:
            signal: name of the signal.
            told: the message.
            time_s: time of arrival, in monotonic seconds.

        Raises:
            Exception: the message is damaged, or no keyframe came before it.
        """
        at = told["timestamp"]
        converter = self._converters.setdefault(signal, VideoConverter())
        # The times of the recording, because a slow playback has long pauses between keyframes.
        value = converter.take(told, at["sec"] + at["nsec"] / _SECOND_NS)
        if not isinstance(value, bytes):
            raise TypeError(f"{signal} is no video")
        return with_time(value, time_s)

    def lose(self) -> None:
        """Leave out all access units up to the next keyframe, because some are missing."""
        for converter in self._converters.values():
            converter.lose()
