"""Type names in the forms of ROS 1 and ROS 2."""

from typing import Final

__all__ = ["is_video", "spelled"]

_VIDEOS: Final = ("foxglove/CompressedVideo", "ffmpeg_image_transport_msgs/FFMPEGPacket")


def spelled(name: str, kind: str, ros: int | None) -> str:
    """Return the type `name` in the form that a ROS version uses.

    Args:
        name: ``pkg/Type`` or ``pkg/msg/Type``; an empty name stays empty.
        kind: middle part of the name: ``msg``, ``srv`` or ``action``.
        ros: ROS version 1 or 2; None to return the name as written.
    """
    words = name.split("/")
    if ros is None or not all(words) or len(words) not in (2, 3):
        return name
    return f"{words[0]}/{words[-1]}" if ros == 1 else f"{words[0]}/{kind}/{words[-1]}"


def is_video(name: str) -> bool:
    """Return whether messages of a type contain the encoded images of a video."""
    words = name.replace("foxglove.", "foxglove/").split("/")
    return f"{words[0]}/{words[-1]}" in _VIDEOS
