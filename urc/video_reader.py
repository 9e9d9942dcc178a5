"""Checks of the encoded images of a stream, and their conversion to access units.

Pure. A stream comes from a camera or from messages of a robot. Only its parameter sets are read, so
nothing is decoded; see `urc._h264`.
"""

from typing import Final

from urc._h264 import BadStream, StreamInfo, info_of, is_keyframe, with_parameter_sets
from urc.images import MAX_PIXELS
from urc.video import MAX_UNIT_BYTES, VideoUnit

__all__ = ["NO_KEYFRAME_S", "UnitReader", "VideoFault"]

NO_KEYFRAME_S: Final = 20.0
"""Maximum time between two keyframes, in seconds."""


class VideoFault(Exception):
    """Raised for a stream that cannot be used, with a message in one line."""


class UnitReader:
    """Turns the packets of one stream into access units, and checks them."""

    def __init__(self, *, is_hevc: bool, extra: bytes = b"", began_s: float) -> None:
        """Create a reader.

        Args:
            is_hevc: whether the stream is H.265 instead of H.264.
            extra: parameter sets that the container states separately.
            began_s: time of the first packet, in seconds.
        """
        self._is_hevc = is_hevc
        self._extra = extra
        self._key_s = began_s
        """Time of the newest keyframe."""
        self._info: StreamInfo | None = None

    def unit(self, data: bytes, now_s: float) -> VideoUnit | None:
        """Return a packet as an access unit; None before the first keyframe.

        Raises:
            VideoFault: the stream exceeds a limit, or has no keyframes.
        """
        if len(data) > MAX_UNIT_BYTES:
            raise VideoFault(
                f"an encoded image has {len(data)} bytes; the limit is {MAX_UNIT_BYTES}:"
                " lower the bit rate in the camera's settings"
            )
        is_key = is_keyframe(data, is_hevc=self._is_hevc)
        if is_key:
            self._key_s = now_s
            data = with_parameter_sets(data, self._extra, is_hevc=self._is_hevc)
        elif now_s - self._key_s > NO_KEYFRAME_S:
            raise VideoFault(
                f"no keyframe within {NO_KEYFRAME_S:g} s: set a keyframe interval of 1 s in the"
                " camera's settings"
            )
        self._take_info(data)
        if self._info is None:
            return None
        codec, width, height = self._info
        return VideoUnit(codec, is_key, width, height, now_s, data)

    def _take_info(self, data: bytes) -> None:
        try:
            found = info_of(data, is_hevc=self._is_hevc)
        except BadStream as fault:
            raise VideoFault(f"the camera's stream is damaged: {fault}") from fault
        if found is None:
            return
        if found.width * found.height > MAX_PIXELS:
            raise VideoFault(
                f"the camera sends images of {found.width} by {found.height} pixels; the limit is"
                f" {MAX_PIXELS} in total: select a smaller image in the camera's settings"
            )
        self._info = found
