"""The way from a packet of the video library to the access units that leave the camera's process.

H.264 and H.265 pass unchanged, and so do the JPEG files of a camera of this computer. All other
codecs need `transcode` in the document. With `transcode`, only the wanted codec passes unchanged.
"""

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Final, NamedTuple

from urc.images import MAX_PIXELS
from urc.transports.camera_records import DemuxJob, UnitQueue, put_units
from urc.transports.jpeg_tables import usual_tables, with_tables
from urc.transports.rtsp_delimiters import without_delimiter
from urc.video import JPEG, MAX_UNIT_BYTES, VideoUnit
from urc.video_reader import UnitReader, VideoFault

__all__ = ["PacketWay", "device_time_s", "packet_way"]

_PASSED: Final = {"h264": False, "hevc": True}
"""Whether the codec is H.265, keyed by the library's name."""
_MOST_BYTES: Final = 4 * MAX_PIXELS
"""Maximum size of an image that is decoded here, in bytes."""
_DECODED: Final = "decoded"
"""Codec of units that do not leave the process."""
_OLDEST_S: Final = 10.0
"""Highest credible age of a device's image, in seconds."""


_Read = Callable[[bytes, bool, float], VideoUnit | None]
"""Function that returns the unit of a packet; None if it cannot be used yet. Its arguments are the
data, whether it is a keyframe, and its time in seconds."""


class PacketWay(NamedTuple):
    """The way of a stream's packets."""

    read: _Read
    put: Callable[[Iterable[VideoUnit]], None]
    """Function that passes units on."""
    end: Callable[[], None]
    """Function that passes all waiting units on."""


def packet_way(av: Any, job: DemuxJob, stream: Any, began_s: float, queue: UnitQueue) -> PacketWay:
    """Return the way of a stream's packets.

    Args:
        av: the package PyAV.
        job: description of the stream.
        stream: the library's video stream.
        began_s: time of the first packet, in seconds.
        queue: target of the access units.

    Raises:
        VideoFault: the codec cannot be passed on.
    """
    name, wanted = stream.codec_context.name, job.transcode
    pass_on = partial(put_units, queue=queue)
    if name in _PASSED and (not wanted or name == wanted.partition("_")[0]):
        return PacketWay(_passing(stream, began_s), pass_on, _nothing)
    if name == "mjpeg" and (wanted == "jpeg" or (job.device and not wanted)):
        return PacketWay(_files(av, stream), pass_on, _nothing)
    if wanted:
        from urc.transports.transcoder import ENCODERS, Transcoder

        make = partial(_decoder, av, stream)
        transcoder = Transcoder(av, name, make, ENCODERS[wanted], queue)
        read = _passing(stream, began_s) if name in _PASSED else _whole(_DECODED, stream)
        return PacketWay(read, transcoder.put, transcoder.end)
    raise VideoFault(
        f"the camera sends {name}; URC passes on H.264 and H.265: select one of them in the"
        " camera's settings, or write transcode: h264"
    )


def device_time_s(packet: Any, came_s: float) -> float:
    """Return when a device captured an image, in monotonic seconds; else when the image came.

    Linux states this time on the same clock (`V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC`).
    """
    if packet.pts is None:
        return came_s
    stated_s = float(packet.pts * packet.time_base)
    return stated_s if 0 <= came_s - stated_s <= _OLDEST_S else came_s


def _nothing() -> None:
    """Units that pass unchanged do not wait."""


def _passing(stream: Any, began_s: float) -> _Read:
    extra = stream.codec_context.extradata or b""
    if not extra.startswith((b"\x00\x00\x01", b"\x00\x00\x00\x01")):
        extra = b""  # MP4 states it in another form; a filter adds it to the keyframes
    is_hevc = _PASSED[stream.codec_context.name]
    reader = UnitReader(is_hevc=is_hevc, extra=extra, began_s=began_s)
    return lambda data, _, time_s: reader.unit(without_delimiter(data), time_s)


def _files(av: Any, stream: Any) -> _Read:
    """Return a function for JPEG files, which adds tables that the camera has left out."""
    tables, read = usual_tables(av), _whole(JPEG, stream, MAX_UNIT_BYTES)
    return lambda data, is_key, time_s: read(with_tables(data, tables), is_key, time_s)


def _whole(codec: str, stream: Any, most: int = _MOST_BYTES) -> _Read:
    """Return a function for packets whose content this process does not check."""
    context = stream.codec_context
    width, height = context.width, context.height
    if width * height > MAX_PIXELS:
        raise VideoFault(
            f"the camera sends images of {width} by {height} pixels; the limit is {MAX_PIXELS} in"
            " total: select a smaller image"
        )

    def read(data: bytes, is_key: bool, time_s: float) -> VideoUnit:
        if len(data) > most:
            raise VideoFault(f"an image has {len(data)} bytes; the limit is {most}")
        return VideoUnit(codec, is_key, min(width, 65535), min(height, 65535), time_s, data)

    return read


def _decoder(av: Any, stream: Any) -> Any:
    context = stream.codec_context
    decoder = av.CodecContext.create(context.name, "r")
    if context.name not in _PASSED:  # their units contain the parameter sets
        if context.extradata:
            decoder.extradata = context.extradata
        decoder.width, decoder.height = context.width, context.height
        if context.pix_fmt:
            decoder.pix_fmt = context.pix_fmt
    decoder.options = {"max_pixels": str(MAX_PIXELS)}
    decoder.thread_type = "SLICE"  # threads for whole images would delay them
    decoder.flags |= av.codec.context.Flags.low_delay
    return decoder
