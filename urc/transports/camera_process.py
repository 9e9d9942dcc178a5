"""The process that takes one camera's stream apart into access units, without decoding images.

``python -m urc.transports.camera_process`` is started by `urc.transports.camera_transport`. A
library written in C parses the bytes of a camera, so the parser has a process of its own. A hostile
or stuck stream can neither block nor crash the server, and the system limits its memory. The
process opens no connection to the network. The stream arrives on standard input, through the relay
of URC, or on a UDP socket of the server. Only WHEP opens sockets in this process
(`urc.transports.whep_line`).

The first line of standard input is a `DemuxJob` as JSON. Standard output contains the records of
`urc.transports.camera_records`.
"""

import json
import os
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterable
from io import RawIOBase
from typing import Any, BinaryIO, Final

from urc.transports.camera_records import (
    FAULT,
    CapturedUnits,
    DemuxJob,
    UnitQueue,
    record_of,
)
from urc.transports.datagram_source import DatagramSource, inherited
from urc.transports.packet_reader import PacketWay, device_time_s, packet_way
from urc.video import VideoUnit
from urc.video_reader import VideoFault

__all__ = ["capture_s", "main"]

MEMORY_BYTES: Final = 2**31
"""Memory of this process, as address space if it encodes nothing; the libraries need 0.5 GB of
address space before they start."""
PROBE_BYTES: Final = 500_000
PROBE_US: Final = 500_000
"""Data and time for the detection of the stream's format."""
_NETWORK_S: Final = 0.005
"""Wait for a packet that shows that the library has no more packets in stock, in seconds."""
_MOST_EARLY: Final = 200
_NICE: Final = 5
"""Increment of the nice value of a process that encodes: driving comes before the images."""
_REFERENCE: Final = struct.Struct("=q")


class EarlyUnits:
    """The access units that the library has kept while it detected the format, with honest times.

    The library delivers them all at once, so the time of delivery would make them too young. The
    last one has just arrived. The time stamps of the stream tell how much older the others are.
    """

    def __init__(self, opened_s: float) -> None:
        """Begin a stream whose first byte arrived at `opened_s` or later."""
        self._opened_s = opened_s
        self._units: list[tuple[VideoUnit, float | None]] = []
        self.is_over = False

    def add(self, unit: VideoUnit, pts_s: float | None) -> None:
        """Add a unit with its time stamp in the stream, in seconds."""
        self._units.append((unit, pts_s))

    def ends(self, waited_s: float) -> bool:
        """Return whether a wait for the next unit shows that it comes from the network."""
        return waited_s > _NETWORK_S or len(self._units) >= _MOST_EARLY

    def stamped(self) -> list[VideoUnit]:
        """Return all units with their times of arrival, and end the early phase."""
        self.is_over = True
        if not self._units:
            return []
        count, (newest, last_pts) = len(self._units), self._units[-1]
        end_s, found = newest.time_s, []
        for place, (unit, pts_s) in enumerate(self._units):
            spread_s = (end_s - self._opened_s) * (count - 1 - place) / count
            older_s = spread_s if pts_s is None or last_pts is None else last_pts - pts_s
            older_s = max(0.0, min(older_s, end_s - self._opened_s))
            found.append(unit._replace(time_s=end_s - older_s))
        return found


def capture_s(packet: Any) -> float | None:
    """Return when an image was captured by the camera's clock, in seconds; None if unknown.

    The library keeps the time as a *producer reference time*: microseconds since 1970 in 64 bits,
    then flags. PyAV passes it on since version 16.
    """
    has_side_data = getattr(packet, "has_sidedata", None)
    if has_side_data is None or not has_side_data("prft"):
        return None
    data = bytes(packet.get_sidedata("prft"))
    if len(data) < _REFERENCE.size:
        return None
    (wall_us,) = _REFERENCE.unpack_from(data)
    return wall_us / 1e6 if wall_us > 0 else None


def read_units(job: DemuxJob, source: RawIOBase | DatagramSource, queue: UnitQueue) -> None:
    """Read a stream until its end, and put its access units into a queue.

    Raises:
        VideoFault: the stream ended or cannot be used.
    """
    import av  # the extra `video`: takes 150 ms

    early = EarlyUnits(time.monotonic())
    try:
        with _opened(av, job, source) as container:
            found = container.streams.video
            if not found:
                raise VideoFault("the camera's stream contains no video")
            way = packet_way(av, job, found[0], time.monotonic(), queue)
            try:
                if job.device:
                    _read_device(container, found[0], way)
                else:
                    reports = bool(job.url)  # sender reports of RTSP
                    _read_stream(av, container, found[0], queue, early, way, has_reports=reports)
            finally:
                way.end()
    except av.error.FFmpegError as fault:
        raise VideoFault(_words(av, fault)) from fault
    raise VideoFault("the camera ended the stream")


def _opened(av: Any, job: DemuxJob, source: RawIOBase | DatagramSource) -> Any:
    limits = {
        "probesize": str(PROBE_BYTES),
        "analyzeduration": str(PROBE_US),
        "fflags": "discardcorrupt",
        "max_delay": "200000",
    }
    if job.device:
        return av.open(job.device, format=job.format, options=dict(job.device_options))
    if job.url:
        options = {
            **limits,
            "rtsp_transport": job.over,
            "allowed_media_types": "video",
            "protocol_whitelist": "rtsp,rtp,udp,tcp",
            "user_agent": "urc",
            "reorder_queue_size": "64",
        }
        return av.open(job.url, options=options, timeout=(10.0, 10.0))
    options = {**limits, "protocol_whitelist": "", "format_whitelist": "mov,mpegts,h264,hevc"}
    return av.open(source, format=job.format or None, options=options, buffer_size=4096)


def _read_stream(
    av: Any,
    container: Any,
    stream: Any,
    queue: UnitQueue,
    early: EarlyUnits,
    way: PacketWay,
    *,
    has_reports: bool,
) -> None:
    dated, convert = CapturedUnits(), _converter(av, stream)
    asked_s = time.monotonic()
    for packet in container.demux(stream):
        came_s = time.monotonic()
        has_data = packet.size > 0  # the filter empties the packet
        if not early.is_over and (not has_data or early.ends(came_s - asked_s)):
            way.put(early.stamped())
        captured_s = capture_s(packet) if has_reports else None  # the filter drops it
        for one in convert(packet) if has_data else ():
            unit = way.read(bytes(one), bool(one.is_keyframe), came_s)
            if unit is not None and early.is_over:
                way.put([dated.aged(unit, captured_s, queue)])
            elif unit is not None:
                early.add(unit, None if one.pts is None else float(one.pts * one.time_base))
        asked_s = time.monotonic()


def _read_device(container: Any, stream: Any, way: PacketWay) -> None:
    """Read a camera of this computer, which keeps no images while the library opens it."""
    for packet in container.demux(stream):
        if packet.size > 0:
            time_s = device_time_s(packet, time.monotonic())
            unit = way.read(bytes(packet), bool(packet.is_keyframe), time_s)
            way.put([unit] if unit is not None else [])


def _converter(av: Any, stream: Any) -> Callable[[Any], Iterable[Any]]:
    """Return the conversion of packets of MP4, which have lengths instead of start codes."""
    name = {"h264": "h264_mp4toannexb", "hevc": "hevc_mp4toannexb"}.get(stream.codec_context.name)
    extra = stream.codec_context.extradata or b""
    if name is None or not extra or extra.startswith((b"\x00\x00\x01", b"\x00\x00\x00\x01")):
        return lambda packet: [packet]
    filtered: Callable[[Any], Iterable[Any]] = av.BitStreamFilterContext(name, stream).filter
    return filtered


def _words(av: Any, fault: Exception) -> str:
    """Return a library error in one line."""
    errors = av.error
    for kind, words in (
        (errors.HTTPUnauthorizedError, "the camera refuses the user name or the password"),
        (errors.HTTPForbiddenError, "the camera refuses the user name or the password"),
        (errors.HTTPNotFoundError, "the camera has no stream at this path of the url"),
        (errors.InvalidDataError, "the stream is neither H.264 nor H.265 in a known format"),
        (errors.TimeoutError, "the camera stopped sending"),
        (errors.EOFError, "the camera ended the stream"),
        (errors.FileNotFoundError, "this computer has no such device"),
        (errors.PermissionError, "URC may not open the device: add its user to the group video"),
    ):
        if isinstance(fault, kind):
            return words
    return f"the stream cannot be read ({getattr(fault, 'strerror', fault)})"


def _limit(job: DemuxJob) -> None:
    """Limit the memory of this process; if it encodes, also its share of the processor."""
    if sys.platform == "linux":
        import resource

        # Drivers of graphics cards reserve large parts of the address space, without using them.
        kind = resource.RLIMIT_DATA if job.transcode else resource.RLIMIT_AS
        resource.setrlimit(kind, (MEMORY_BYTES, MEMORY_BYTES))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if job.transcode and hasattr(os, "nice"):
        os.nice(_NICE)


def _end_with(source: RawIOBase) -> None:
    """End the process as soon as standard input ends, which the server's death also causes."""
    while source.read(4096):
        pass
    os._exit(0)


def _write_all(queue: UnitQueue, target: BinaryIO) -> None:
    try:
        while (record := queue.take()) is not None:
            target.write(record)
            target.flush()
    except OSError:
        os._exit(0)  # the server has closed the pipe


def _line(source: RawIOBase) -> bytes:
    """Return the next line of standard input; b"" at its end."""
    line = bytearray()
    while not line.endswith(b"\n"):
        piece = source.read(1)
        if not piece:
            return b""
        line += piece
    return bytes(line)


def _read(job: DemuxJob, source: RawIOBase, queue: UnitQueue) -> None:
    if job.hosts:
        from urc.transports.whep_receiver import read_whep  # the extra `whep`

        read_whep(job, lambda: _line(source), lambda: _end_with(source), queue)
        return
    if job.url or job.device or job.socket:
        threading.Thread(target=_end_with, args=(source,), daemon=True).start()
    if job.socket:
        datagrams = DatagramSource(inherited(job.socket), job.senders)
        read_units(job._replace(format=datagrams.format()), datagrams, queue)
        return
    read_units(job, source, queue)


def main() -> int:
    """Run the process; return the exit code."""
    source, target = os.fdopen(0, "rb", buffering=0), os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # so that no library's text reaches the records
    line = _line(source)
    if not line:
        return 0
    job, queue = DemuxJob(**json.loads(line)), UnitQueue()
    _limit(job)
    writer = threading.Thread(target=_write_all, args=(queue, target), daemon=True)
    writer.start()
    try:
        _read(job, source, queue)
    except VideoFault as fault:
        queue.put(record_of(FAULT, str(fault).encode()), is_key=True)
    except MemoryError:
        queue.put(record_of(FAULT, b"the stream needs too much memory"), is_key=True)
    except Exception as bug:  # supervisor: the server reports the reason
        text = f"the stream cannot be read ({type(bug).__name__}: {bug})"
        queue.put(record_of(FAULT, text.encode()), is_key=True)
    queue.end()
    writer.join(2.0)
    return 0


if __name__ == "__main__":
    code = main()
    sys.stderr.flush()
    os._exit(code)  # without waiting for the library's threads
