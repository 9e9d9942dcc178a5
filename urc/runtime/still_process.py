"""The process that decodes one video and makes JPEG images, for pages that cannot decode it.

``python -m urc.runtime.still_process`` is started by `urc.runtime.still_maker`. Standard input
contains records: length (u32), then an access unit as the value of a signal (`urc.video`). Standard
output contains records: length (u32), time of arrival in seconds (f64) and a flag (u8), then the
JPEG file. The flag is 1 if the camera repeats the image, which then has the time of the first one.
A slow process skips whole groups of pictures, never single access units.
"""

import os
import struct
import sys
import threading
import zlib
from collections.abc import Iterator
from io import RawIOBase
from typing import Any, Final, NamedTuple

from urc._helper_process import read_exactly
from urc._image_encoders import jpeg_of
from urc.images import MAX_PIXELS
from urc.runtime.standing_pictures import StandingPictures
from urc.transports.camera_records import UnitQueue
from urc.video import MAX_UNIT_BYTES, VideoUnit, read_unit

__all__ = ["EVERY_S", "MADE", "TAKEN", "Still", "main", "stills"]

TAKEN: Final = struct.Struct(">I")
MADE: Final = struct.Struct(">Id?")
EVERY_S: Final = 0.1
"""Least time between two JPEG images, in seconds."""
WIDEST: Final = 1280
"""Maximum width of a JPEG image, in pixels; larger images are scaled."""
MEMORY_BYTES: Final = 2**31
_MOST_BYTES: Final = MAX_UNIT_BYTES + 4096
"""Maximum size of an access unit in a record, in bytes."""
_COLUMNS, _ROWS = 20, 15
"""Numbers of compared blocks in a row and in a column."""
_BLOCK: Final = 16
"""Size of an encoder's block, in pixels."""
_DECODERS: Final = {"avc1": "h264", "hev1": "hevc"}


class Still(NamedTuple):
    """One JPEG image of a video."""

    time_s: float
    """Time of arrival, in seconds; of a repeated image, the arrival of the first one."""
    image: bytes
    """A JPEG file."""
    is_repeated: bool = False
    """Whether the camera repeats an earlier image."""


def stills(units: Iterator[VideoUnit], frozen_after_s: float = 0.0) -> Iterator[Still]:
    """Yield at most ten JPEG images a second.

    Images that cannot be decoded are left out, until the next keyframe.

    Args:
        units: the access units, in order.
        frozen_after_s: time in seconds after which equal images count as one; 0 means never.
    """
    import av  # the extra `video`

    decoder: Any = None
    codec, last_s, needs_key = "", float("-inf"), True
    standing = StandingPictures(frozen_after_s) if frozen_after_s else None
    for unit in units:
        if unit.codec != codec or decoder is None:
            decoder, codec = _decoder(av, unit.codec), unit.codec
        if needs_key and not unit.is_key:
            continue
        packet = av.Packet(unit.data)
        try:
            frames = decoder.decode(packet)
        except av.error.FFmpegError:
            decoder, needs_key = None, True
            continue
        needs_key = False
        for frame in frames:
            if standing is not None and frame.key_frame:
                standing.add_keyframe(_blocks(frame), unit.time_s)
        if frames and unit.time_s - last_s >= EVERY_S * 0.95:
            last_s = unit.time_s
            first_s = standing.first_s(unit.time_s) if standing is not None else None
            time_s = unit.time_s if first_s is None else first_s
            yield Still(time_s, jpeg_of(av, frames[-1], WIDEST), is_repeated=first_s is not None)


def _blocks(frame: Any) -> list[int]:
    """Return the checksums of 300 blocks with 8 rows of 8 bytes, spread over the brightness.

    They lie within the blocks of an encoder, whose edges depend on their neighbours.
    """
    plane = frame.planes[0]
    data, step, height = memoryview(plane), plane.line_size, plane.height
    width = min(step, plane.width * -(-frame.format.components[0].bits // 8))
    if width < _BLOCK or height < _BLOCK:
        return []
    found = []
    for place in range(_COLUMNS * _ROWS):
        row, column = divmod(place, _COLUMNS)
        left, top = _edge(column, _COLUMNS, width), _edge(row, _ROWS, height)
        lines = (data[step * line + left : step * line + left + 8] for line in range(top, top + 8))
        found.append(zlib.crc32(b"".join(lines), place))
    return found


def _edge(number: int, count: int, size: int) -> int:
    return number * size // count // _BLOCK * _BLOCK + 4


def _decoder(av: Any, codec: str) -> Any:
    decoder = av.CodecContext.create(_DECODERS.get(codec.partition(".")[0], "h264"), "r")
    decoder.options = {"max_pixels": str(MAX_PIXELS)}
    decoder.thread_count = 1
    decoder.flags |= av.codec.context.Flags.low_delay
    return decoder


def _read(source: RawIOBase, queue: UnitQueue) -> None:
    """Put the records of standard input into the queue until the server closes the pipe."""
    try:
        while (head := read_exactly(source, TAKEN.size)) is not None:
            (size,) = TAKEN.unpack(head)
            value = read_exactly(source, size) if size <= _MOST_BYTES else None
            if value is None:
                break
            unit = read_unit(value)
            if unit is not None:
                queue.put(value, is_key=unit.is_key)
    except OSError:
        pass
    os._exit(0)


def _taken(queue: UnitQueue) -> Iterator[VideoUnit]:
    while (value := queue.take()) is not None:
        unit = read_unit(value)
        if unit is not None:
            yield unit


def main(frozen_after_s: float = 0.0) -> int:
    """Run the process, with the value of `frozen_after` in seconds; return the exit code."""
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        os.nice(5)  # the page's image matters less than driving
    source, target = os.fdopen(0, "rb", buffering=0), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # so that no library's text reaches the records
    queue = UnitQueue()
    threading.Thread(target=_read, args=(source, queue), daemon=True).start()
    try:
        for time_s, image, is_repeated in stills(_taken(queue), frozen_after_s):
            target.write(MADE.pack(len(image), time_s, is_repeated) + image)
            target.flush()
    except OSError:
        return 0  # the server has closed the pipe
    return 0


if __name__ == "__main__":
    os._exit(main(*map(float, sys.argv[1:])))
