"""Messages between the process of a camera and the server: the job, and a bounded queue of records.

A record has a length (u32) and a kind (u8), then the content. The server reads the records in
`urc.transports.camera_transport`.
"""

import struct
import threading
from collections import deque
from collections.abc import Iterable
from typing import Final, NamedTuple

from urc.capture_clock import CaptureClock, step_words
from urc.video import VideoUnit, encode_unit

__all__ = [
    "FAULT",
    "NOTE",
    "OFFER",
    "RECORD",
    "UNIT",
    "CapturedUnits",
    "DemuxJob",
    "UnitQueue",
    "put_units",
    "record_of",
]

RECORD: Final = struct.Struct(">Ic")
UNIT: Final = b"U"
"""An access unit, as the value of a signal (`urc.video`)."""
FAULT: Final = b"F"
"""A fault in one line, and the last record."""
NOTE: Final = b"N"
"""A line for the log."""
OFFER: Final = b"O"
"""An offer of WHEP, which the server passes on (`urc.transports.whep_sdp`)."""
QUEUE_BYTES: Final = 8_388_608
QUEUE_UNITS: Final = 240
"""Maximum number of queued access units: the oldest group of pictures is dropped first."""
_MOST_REORDERED_S: Final = 0.5
"""Time by which an image may be captured before the previous one, because of B-frames."""
_OLDEST_S: Final = 50.0
"""Highest age before arrival, in seconds; the server does not believe times that are much older."""


class DemuxJob(NamedTuple):
    """A description of the stream to read."""

    url: str = ""
    """Address of the relay, for RTSP; "" for a stream on standard input."""
    format: str = ""
    """Name of the library's demuxer; "" to detect it among the permitted formats."""
    over: str = "tcp"
    """Whether RTP packets travel over ``tcp`` or ``udp``."""
    socket: str = ""
    """For UDP: the bound socket, as `urc.transports.datagram_source.inherited` expects it."""
    senders: tuple[str, ...] = ()
    """For UDP: IP addresses of permitted senders; empty if any sender is permitted."""
    hosts: tuple[str, ...] = ()
    """For WHEP: IP addresses of the camera, the only targets of packets; otherwise empty."""
    own_hosts: tuple[str, ...] = ()
    """For WHEP: IP addresses of this computer from which packets go to the camera."""
    device: str = ""
    """Path of a camera of this computer, such as ``/dev/video0``; `format` is its demuxer."""
    device_options: tuple[tuple[str, str], ...] = ()
    """Options of the device's demuxer, such as ``video_size``, with their values."""
    transcode: str = ""
    """Codec into which other codecs are encoded: a key of `urc.transports.transcoder.ENCODERS`, or
    "" to encode nothing."""


class UnitQueue:
    """A bounded queue of records between the demuxer and standard output.

    The demuxer never waits: a slow reader loses whole groups of pictures, oldest first. A group
    without its beginning could not be decoded.
    """

    def __init__(self, max_units: int = QUEUE_UNITS, max_bytes: int = QUEUE_BYTES) -> None:
        self._max_units = max_units
        self._max_bytes = max_bytes
        self._units: deque[tuple[bool, bytes]] = deque()
        self._bytes = 0
        self._needs_key = True
        self._told = b""
        self._changed = threading.Condition()
        self._is_over = False

    def put(self, record: bytes, *, is_key: bool) -> None:
        """Add an access unit; drop older groups, or this unit, if the queue is full."""
        with self._changed:
            if is_key:
                self._needs_key = False
            elif self._needs_key:
                return
            is_full = len(self._units) >= self._max_units or (
                self._bytes + len(record) > self._max_bytes
            )
            if is_full:
                self._units.clear()
                self._bytes = 0
                if not is_key:
                    self._needs_key = True
                    return
            self._units.append((is_key, record))
            self._bytes += len(record)
            self._changed.notify()

    @property
    def count(self) -> int:
        """Number of access units in the queue."""
        return len(self._units)

    def tell(self, record: bytes) -> None:
        """Add a record that is no access unit; a newer one replaces it."""
        with self._changed:
            self._told = record
            self._changed.notify()

    def take(self) -> bytes | None:
        """Return the next record, after a wait if necessary; None at the end."""
        with self._changed:
            while not self._units:
                if self._told:
                    told, self._told = self._told, b""
                    return told
                if self._is_over:
                    return None
                self._changed.wait()
            _, record = self._units.popleft()
            self._bytes -= len(record)
            return record

    def end(self) -> None:
        """Make `take` return None after the remaining records."""
        with self._changed:
            self._is_over = True
            self._changed.notify()


class CapturedUnits:
    """Makes units older as their times of capture state; see `urc.capture_clock`.

    An RTSP camera states its clock in RTCP sender reports, every few seconds. The library then
    computes the time of each image on this clock. Images before the first report have only their
    time of arrival, and so have all images of other streams.
    """

    def __init__(self) -> None:
        """Begin without a time of capture."""
        self._clock = CaptureClock(_MOST_REORDERED_S)

    def aged(self, unit: VideoUnit, captured_s: float | None, queue: "UnitQueue") -> VideoUnit:
        """Return the unit with its age in its time; put a line about a clock step into `queue`."""
        if captured_s is None:
            return unit
        age = self._clock.age(captured_s, unit.time_s)
        if age.step_s:
            queue.tell(record_of(NOTE, step_words(age.step_s).encode()))
        return unit._replace(time_s=unit.time_s - min(age.older_s, _OLDEST_S))


def put_units(units: Iterable[VideoUnit], queue: UnitQueue) -> None:
    """Put access units into a queue."""
    for unit in units:
        queue.put(record_of(UNIT, encode_unit(unit)), is_key=unit.is_key)


def record_of(kind: bytes, content: bytes) -> bytes:
    """Return a record."""
    return RECORD.pack(len(content), kind) + content
