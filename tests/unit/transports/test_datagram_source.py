"""The datagrams of a camera as a stream of bytes, with a line that the test fills."""

from collections.abc import Iterable
from typing import Any

import pytest

from urc.transports.datagram_source import DatagramSource
from urc.video_reader import VideoFault

CAMERA, STRANGER = "10.0.0.2", "10.0.0.9"
TS = (b"\x47" + bytes(187)) * 2
NAL = b"\0\0\0\1\x67" + bytes(20)


class Line:
    """A socket with some datagrams; after them, nothing arrives within any time limit."""

    def __init__(self, datagrams: Iterable[tuple[bytes, str]]) -> None:
        self._datagrams = list(datagrams)
        self.limit_s: float | None = None

    def settimeout(self, limit_s: float | None) -> None:
        self.limit_s = limit_s

    def getsockname(self) -> tuple[str, int]:
        return "0.0.0.0", 11111

    def recvfrom_into(self, buffer: memoryview) -> tuple[int, tuple[str, int]]:
        if not self._datagrams:
            raise TimeoutError
        data, host = self._datagrams.pop(0)
        buffer[: len(data)] = data
        return len(data), (host, 4000)

    def recv_into(self, buffer: memoryview) -> int:
        return self.recvfrom_into(buffer)[0]


def source(*datagrams: tuple[bytes, str], senders: Iterable[str] = ()) -> DatagramSource:
    line: Any = Line(datagrams)
    return DatagramSource(line, senders)


@pytest.mark.parametrize(
    ("first", "found"), [(TS, "mpegts"), (NAL, "h264"), (TS + b"\x47", "h264")]
)
def test_the_first_datagram_tells_the_format_and_is_not_lost(first: bytes, found: str) -> None:
    stream = source((first, CAMERA))
    assert stream.format() == found
    assert stream.read(4096) == first


def test_a_datagram_may_be_larger_than_a_read() -> None:
    stream = source((b"abcde", CAMERA), (b"fg", CAMERA))
    assert [stream.read(3) for _ in range(3)] == [b"abc", b"de", b"fg"]


def test_only_datagrams_of_permitted_senders_count() -> None:
    stream = source((b"x", STRANGER), (b"", CAMERA), (b"yes", CAMERA), senders=[CAMERA])
    assert stream.read(9) == b"yes"


def test_the_scope_of_an_ipv6_sender_does_not_matter() -> None:
    assert source((b"yes", "fe80::1%eth0"), senders=["fe80::1"]).read(9) == b"yes"


@pytest.mark.parametrize(("senders", "words"), [([], ""), ([CAMERA], " from 10.0.0.2")])
def test_a_camera_that_sends_nothing_is_named(senders: list[str], words: str) -> None:
    with pytest.raises(VideoFault) as told:
        source((b"x", STRANGER) if senders else (b"", CAMERA), senders=senders).format()
    assert str(told.value) == f"no datagram{words} has reached udp port 11111 within 14 s"


def test_later_reads_have_no_limit_because_the_server_ends_a_silent_stream() -> None:
    line: Any = Line([(NAL, CAMERA)])
    DatagramSource(line, ()).format()
    assert line.limit_s is None
