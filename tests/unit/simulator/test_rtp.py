"""RTP with H.264: each NAL unit arrives as it was sent, and reports tell the camera's clock."""

import struct

import pytest

from urc.model.driver import TransportSpec
from urc.simulator.emulated_robot import EmulatedRobot
from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.rtp import MAX_PAYLOAD, RtpStream
from urc.simulator.servers.rtsp import REPORT_EVERY_S, RtpReceiver
from urc.simulator.servers.video_encoder import EncodedUnit
from urc.testing.profile import line_profile

START = b"\0\0\0\1"
SPS, PPS = b"\x67\x42\xc0\x0d\x99", b"\x68\xce\x3c\x80"
SOURCE = 0x11223344


def put_together(packets: list[bytes]) -> list[bytes]:
    """Return the NAL units in packets, as RFC 6184 puts them together."""
    found: list[bytes] = []
    for packet in packets:
        payload = packet[12:]
        if payload[0] & 0x1F != 28:
            found.append(payload)
            continue
        if payload[1] & 0x80:
            found.append(bytes((payload[0] & 0xE0 | payload[1] & 0x1F,)))
        found[-1] += payload[2:]
    return found


def fields(packet: bytes) -> tuple[int, ...]:
    return struct.unpack(">BBHII", packet[:12])


@pytest.mark.parametrize("more", [-2, -1, 0, 1, 2, MAX_PAYLOAD - 2, 3 * MAX_PAYLOAD])
def test_long_units_are_cut_and_fit_together_again(more: int) -> None:
    image = b"\x65" + bytes(place % 251 + 1 for place in range(MAX_PAYLOAD - 1 + more))
    unit = b"".join(START + nal for nal in (SPS, PPS, image))
    packets = list(RtpStream(SOURCE, 7).packets(unit, 100.0))
    assert put_together(packets) == [SPS, PPS, image]
    assert all(len(one) <= 12 + MAX_PAYLOAD for one in packets)
    fragments = [one[12:14] for one in packets[2:] if one[12] & 0x1F == 28]
    assert bool(fragments) == (len(image) > MAX_PAYLOAD)
    if fragments:
        marks = [fragment[1] & 0xC0 for fragment in fragments]
        assert marks == [0x80, *[0] * (len(marks) - 2), 0x40]


def test_packets_are_numbered_and_only_the_last_of_an_image_is_marked() -> None:
    """The number starts anew after 65535; all packets of an image have one time stamp."""
    stream = RtpStream(SOURCE, 0xFFFF)
    unit = START + SPS + START + b"\x65\x88"
    first, second = list(stream.packets(unit, 2.0))
    (third,) = stream.packets(START + b"\x41\x9a", 2.1)
    assert fields(first) == (0x80, 96, 0xFFFF, 180_000, SOURCE)
    assert fields(second) == (0x80, 0x80 | 96, 0, 180_000, SOURCE)
    assert fields(third) == (0x80, 0x80 | 96, 1, 189_000, SOURCE)


def test_a_report_tells_the_time_of_day_of_a_stamp() -> None:
    """RFC 3550, 6.4.1; the time counts from 1900."""
    stream = RtpStream(SOURCE, 0)
    assert len(list(stream.packets(START + SPS + START + b"\x65\x88", 0.25))) == 2
    report = stream.report(1_000_000_000.25)
    version, kind, words, *rest = struct.unpack(">BBHIIIIII", report)
    assert (version, kind, 4 * (words + 1)) == (0x80, 200, len(report))
    stamp = round(1_000_000_000.25 * 90_000) % 2**32
    assert rest == [SOURCE, 3_208_988_800, 2**30, stamp, 2, len(SPS) + 2]


class Way:
    """Takes packets while it is free."""

    def __init__(self) -> None:
        self.free = True
        self.taken: list[tuple[bool, bytes]] = []

    def is_free(self) -> bool:
        return self.free

    def put(self, data: bytes, *, is_report: bool) -> None:
        self.taken.append((is_report, data))

    def close(self) -> None:
        self.free = False


def test_a_slow_client_continues_with_a_keyframe_and_reports_come_every_few_seconds() -> None:
    robot, now_s = EmulatedRobot(line_profile(), {}), 100.0
    spec = TransportSpec("eye", "camera")
    line = robot.line("wire")
    context = ServerContext("eye", spec, {}, "127.0.0.1", lambda: line, lambda: now_s)
    way = Way()
    client = RtpReceiver(context, way)
    assert client.is_ready()
    client.needs_key = False  # as after a keyframe
    client.take(EncodedUnit(is_key=True, data=START + b"\x65\x88"))
    assert [is_report for is_report, _ in way.taken] == [True, False]
    way.free = False
    assert not client.is_ready()
    assert client.needs_key
    way.free = True
    assert client.is_ready()
    assert client.needs_key
    for expected in ([False], [True, False]):
        way.taken.clear()
        client.take(EncodedUnit(is_key=True, data=START + b"\x65\x88"))
        assert [is_report for is_report, _ in way.taken] == expected
        now_s += REPORT_EVERY_S
