"""Messages with the encoded images of a video.

Pure. Each message contains one access unit: a foxglove.CompressedVideo, or an FFMPEGPacket of the
ROS package ffmpeg_image_transport_msgs. Without the access units before it, an access unit cannot
be decoded. After a loss, the converter therefore drops all messages up to the next keyframe.
"""

from collections.abc import Mapping
from typing import Final

from urc.expressions import quoted
from urc.model.values import Reading
from urc.protocol.values.convert import BadValue
from urc.protocol.values.vectors import bytes_of, video_converter
from urc.video import encode_unit
from urc.video_reader import UnitReader, VideoFault

__all__ = ["GAP", "VideoConverter", "Waiting"]

GAP: Final = "_ gap"
"""Hidden field of a message whose predecessors were lost. The blank sets its name apart from all
names in documents."""
_CODECS: Final = {
    "h264": False,
    "libx264": False,
    "avc": False,
    "h265": True,
    "libx265": True,
    "hevc": True,
}
"""Whether a codec is H.265, keyed by the beginnings of its names."""


class Waiting(Exception):
    """Raised for an access unit that cannot be decoded, until the next keyframe."""


class VideoConverter:
    """The converter of one signal of type ``video``."""

    def __init__(self) -> None:
        self._reader: UnitReader | None = None
        self._is_hevc = False
        self._needs_key = True

    def __call__(self, raw: object) -> Reading:
        """Return an access unit in the form of a camera; raise `BadValue` for anything else."""
        return video_converter(raw)

    def lose(self) -> None:
        """Drop all messages up to the next keyframe, because messages were lost."""
        self._needs_key = True

    def take(self, raw: object, now: float) -> Reading:
        """Return the access unit of a message that arrived at `now`.

        Raises:
            BadValue: the message contains no supported access unit.
            Waiting: the message lies between a loss and the next keyframe.
        """
        try:
            return self._taken(raw, now)
        except BadValue:
            self._needs_key = True  # the refused message is missing from its group
            raise

    def _taken(self, raw: object, now: float) -> Reading:
        if not isinstance(raw, Mapping):
            return video_converter(raw)
        is_hevc = _is_hevc(raw)
        if self._reader is None or is_hevc != self._is_hevc:
            self._reader, self._is_hevc = UnitReader(is_hevc=is_hevc, began_s=now), is_hevc
            self._needs_key = True
        try:
            unit = self._reader.unit(bytes_of(raw.get("data")), now)
        except VideoFault as fault:
            self._reader = None
            raise BadValue(str(fault)) from None
        if unit is None or (self._needs_key and not unit.is_key):
            raise Waiting
        self._needs_key = False
        return encode_unit(unit)


def _is_hevc(message: Mapping[str, object]) -> bool:
    name = message.get("format", message.get("encoding"))
    if "data" not in message or not isinstance(name, str):
        raise BadValue(f"{quoted(message)} is no message with a video")
    codec = name.lower().replace(".", "")
    for known, is_hevc in _CODECS.items():
        if codec.startswith(known):
            return is_hevc
    raise BadValue(f"the video has the format {quoted(name)}; URC supports H.264 and H.265")
