"""The process that decodes one video and makes JPEG images, for pages that cannot decode it.

``python -m urc.runtime.still_process`` is started by `urc.runtime.still_maker`. Standard input
contains records: length (u32), then an access unit as the value of a signal (`urc.video`). Standard
output contains records: length (u32) and time of arrival of the image in seconds (f64), then the
JPEG file. A slow process skips whole groups of pictures, never single access units.
"""

import os
import struct
import sys
import threading
from collections.abc import Iterator
from fractions import Fraction
from io import RawIOBase
from typing import Any, Final

from urc.images import MAX_PIXELS
from urc.transports.camera_records import UnitQueue
from urc.video import MAX_UNIT_BYTES, VideoUnit, read_unit

__all__ = ["EVERY_S", "MADE", "TAKEN", "StillMakerFault", "main", "stills"]

TAKEN: Final = struct.Struct(">I")
MADE: Final = struct.Struct(">Id")
EVERY_S: Final = 0.1
"""Least time between two JPEG images, in seconds."""
WIDEST: Final = 1280
"""Maximum width of a JPEG image, in pixels; larger images are scaled."""
MEMORY_BYTES: Final = 2**31
_QUALITY: Final = 5
"""Quantiser of the JPEG encoder: 2 is the best image, 31 the smallest file."""
_DECODERS: Final = {"avc1": "h264", "hev1": "hevc"}


class StillMakerFault(Exception):
    """Raised for input that is no sequence of records."""


def stills(units: Iterator[VideoUnit]) -> Iterator[tuple[float, bytes]]:
    """Yield the arrival time and the JPEG file of at most ten images a second.

    Images that cannot be decoded are left out, until the next keyframe.
    """
    import av  # the extra `video`

    decoder: Any = None
    codec, last_s, needs_key = "", float("-inf"), True
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
        if frames and unit.time_s - last_s >= EVERY_S * 0.95:
            last_s = unit.time_s
            yield unit.time_s, _jpeg(av, frames[-1])


def _decoder(av: Any, codec: str) -> Any:
    decoder = av.CodecContext.create(_DECODERS.get(codec.partition(".")[0], "h264"), "r")
    decoder.options = {"max_pixels": str(MAX_PIXELS)}
    decoder.thread_count = 1
    decoder.flags |= av.codec.context.Flags.low_delay
    return decoder


def _jpeg(av: Any, frame: Any) -> bytes:
    width, height = frame.width, frame.height
    if width > WIDEST:
        width, height = WIDEST, max(2, round(height * WIDEST / width / 2) * 2)
    plain = frame.reformat(width, height, "yuvj420p")
    encoder = av.CodecContext.create("mjpeg", "w")
    encoder.width, encoder.height, encoder.pix_fmt = width, height, "yuvj420p"
    encoder.time_base = Fraction(1, 30)
    encoder.options = {"qmin": str(_QUALITY), "qmax": str(_QUALITY)}
    plain.pts = 0
    packets = [*encoder.encode(plain), *encoder.encode(None)]
    return b"".join(bytes(packet) for packet in packets)


def _read(source: RawIOBase, queue: UnitQueue) -> None:
    """Put the records of standard input into the queue until the server closes the pipe."""
    try:
        while True:
            (size,) = TAKEN.unpack(_exactly(source, TAKEN.size))
            if size > MAX_UNIT_BYTES + 4096:
                raise StillMakerFault
            value = _exactly(source, size)
            unit = read_unit(value)
            if unit is not None:
                queue.put(value, is_key=unit.is_key)
    except (StillMakerFault, OSError):
        os._exit(0)


def _exactly(source: RawIOBase, size: int) -> bytes:
    data = bytearray()
    while len(data) < size:
        piece = source.read(size - len(data))
        if not piece:
            raise StillMakerFault
        data += piece
    return bytes(data)


def _taken(queue: UnitQueue) -> Iterator[VideoUnit]:
    while (value := queue.take()) is not None:
        unit = read_unit(value)
        if unit is not None:
            yield unit


def main() -> int:
    """Run the process; return the exit code."""
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
        for time_s, image in stills(_taken(queue)):
            target.write(MADE.pack(len(image), time_s) + image)
            target.flush()
    except OSError:
        return 0  # the server has closed the pipe
    return 0


if __name__ == "__main__":
    os._exit(main())
