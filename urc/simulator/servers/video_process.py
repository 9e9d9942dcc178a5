"""The process that encodes the images of one emulated camera as H.264, without delaying the robot.

``python -m urc.simulator.servers.video_process`` is started by
`urc.simulator.servers.video_encoder`. The encoder needs milliseconds for an image, in which the
robot must still answer commands. The process ends with its standard input.

Standard input contains records: length (u32) and a flag (u8), then an image as JPEG or PNG. The
flag is 1 if the image must become a keyframe. For each image, standard output contains one record:
length (u32) and kind (u8), then the content. The kind ``K`` is a keyframe with its parameter sets,
and ``U`` any other access unit. Both have the byte stream format of ITU-T H.264, Annex B. The kind
``F`` is a fault in one line, and the last record.
"""

import os
import struct
import sys
import time
from collections.abc import Callable
from io import RawIOBase
from typing import Any, BinaryIO, Final

from urc._helper_process import read_exactly
from urc._image_encoders import FrameEncoder

__all__ = [
    "FAULT",
    "KEYFRAME",
    "MAX_IMAGE_BYTES",
    "ORDER",
    "RECORD",
    "UNIT",
    "ImageEncoder",
    "main",
]

ORDER: Final = struct.Struct(">IB")
RECORD: Final = struct.Struct(">Ic")
KEYFRAME: Final = b"K"
UNIT: Final = b"U"
FAULT: Final = b"F"
MAX_IMAGE_BYTES: Final = 8_388_608
"""Maximum size of an image in a record, in bytes."""
_NICE: Final = 5
"""Increment of the process's nice value, so that the robot comes before the images."""
_PNG: Final = b"\x89PNG"


class ImageEncoder:
    """Encodes images one by one; each image becomes one access unit at once.

    Args:
        clock: function that returns monotonic time in seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        import av  # the extra `video`: takes 150 ms

        self._av: Any = av
        self._clock = clock
        self._encoder = FrameEncoder(av, clock())
        self._decoders: dict[str, Any] = {}

    def encode(self, image: bytes, *, is_key: bool = False) -> tuple[bool, bytes]:
        """Return whether an image has become a keyframe, and its access unit.

        Args:
            image: JPEG or PNG.
            is_key: whether the image must become a keyframe.

        Raises:
            av.error.FFmpegError: the image is damaged.
        """
        (made,) = self._encoder.encode(self._decoded(image), self._clock(), is_key=is_key)
        return made.is_key, made.data

    def _decoded(self, image: bytes) -> Any:
        name = "png" if image.startswith(_PNG) else "mjpeg"
        if name not in self._decoders:
            self._decoders[name] = self._av.CodecContext.create(name, "r")
        return self._decoders[name].decode(self._av.Packet(image))[0]


def _serve(source: RawIOBase, target: BinaryIO) -> None:
    encoder = ImageEncoder()
    while (head := read_exactly(source, ORDER.size)) is not None:
        size, is_key = ORDER.unpack(head)
        if size > MAX_IMAGE_BYTES or (image := read_exactly(source, size)) is None:
            return
        is_key, unit = encoder.encode(image, is_key=bool(is_key))
        target.write(RECORD.pack(len(unit), KEYFRAME if is_key else UNIT) + unit)
        target.flush()


def main() -> int:
    """Run the process; return the exit code."""
    if hasattr(os, "nice"):
        os.nice(_NICE)
    source, target = os.fdopen(0, "rb", buffering=0), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # so that no library's text reaches the records
    try:
        _serve(source, target)
    except OSError:
        return 0  # the simulator has closed the pipe
    except Exception as bug:  # supervisor: the simulator reports the reason
        text = f"{type(bug).__name__}: {bug}".replace("\n", " ").encode()[:300]
        target.write(RECORD.pack(len(text), FAULT) + text)
        target.flush()
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # without waiting for the library's threads
