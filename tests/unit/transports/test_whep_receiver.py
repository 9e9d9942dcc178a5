"""The receiver of WHEP without a network: what it passes on, and what it asks the sender for."""

import asyncio
import struct
from collections.abc import Callable
from typing import Any, cast

import pytest
from aioice.stun import Class, Message, Method
from aiortc import RTCDtlsTransport
from aiortc.rtp import (
    RtcpByePacket,
    RtcpPacket,
    RtcpPsfbPacket,
    RtcpRrPacket,
    RtcpRtpfbPacket,
    RtcpSenderInfo,
    RtcpSrPacket,
    RtpPacket,
)

from tests.unit.transports.rtp_packets import film, pieces_of
from urc.transports.camera_records import RECORD, UNIT, UnitQueue
from urc.transports.rtp_assembler import WAIT_S, RtpPiece
from urc.transports.whep_line import CameraLine
from urc.transports.whep_receiver import ENDED, WhepReceiver
from urc.transports.whep_sdp import IceHost, WhepAnswer
from urc.video import MAX_UNIT_BYTES, VideoUnit, read_unit
from urc.video_reader import VideoFault

pytestmark = pytest.mark.anyio

FILM = film(6)
ANSWER = WhepAnswer(
    "abCD", "x" * 22, True, (("sha-256", "AB"),), False, ((102, False),), (IceHost("a", 1, 1, "1"),)
)
SSRC = 77


class Transport:
    """A DTLS transport that keeps what would leave."""

    def __init__(self) -> None:
        self.state = "connected"
        self.sent: list[Any] = []
        self.has_sent = asyncio.Event()
        self.types: list[int] = []
        self._listeners: list[Callable[[], None]] = []

    def on(self, event: str, call: Callable[[], None]) -> None:
        assert event == "statechange"
        self._listeners.append(call)

    def close(self) -> None:
        self.state = "closed"
        for call in self._listeners:
            call()

    def _register_rtp_receiver(self, receiver: object, parameters: Any) -> None:
        self.types = [one.payloadType for one in parameters.codecs]

    async def _send_rtp(self, data: bytes) -> None:
        if self.state == "closed":
            raise ConnectionError
        self.sent += RtcpPacket.parse(data)
        self.has_sent.set()


class Clock:
    """The time of arrival of the next packets."""

    now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr("urc.transports.whep_receiver.time", made)
    return made


class Far:
    """The far end of a receiver."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.transport = Transport()
        self.queue = UnitQueue()
        self.receiver = WhepReceiver(cast(RTCDtlsTransport, self.transport), ANSWER, self.queue)

    async def send(self, pieces: list[RtpPiece], *, ssrc: int = SSRC) -> None:
        for piece in pieces:
            self.clock.now_s = piece.came_s + 90.0
            packet = RtpPacket(102, int(piece.is_last), piece.number, piece.stamp, ssrc)
            packet.payload = piece.payload
            await self.receiver._handle_rtp_packet(packet, 0)

    def units(self) -> list[VideoUnit]:
        """Return the units so far; afterwards, the queue is at its end."""
        self.queue.end()
        found = []
        for record in iter(self.queue.take, None):
            _, kind = RECORD.unpack_from(record)
            assert kind == UNIT
            unit = read_unit(record[RECORD.size :])
            assert unit is not None
            found.append(unit)
        return found

    def asked(self, kind: type) -> list[Any]:
        return [packet for packet in self.transport.sent if isinstance(packet, kind)]

    async def reason(self) -> str:
        with pytest.raises(VideoFault) as told:
            await self.receiver.run()
        return str(told.value)


async def test_a_film_is_passed_on_and_nothing_is_asked_for(clock: Clock) -> None:
    far = Far(clock)
    await far.send(pieces_of(FILM))
    units = far.units()
    assert [unit.is_key for unit in units] == [True, False, True, False, True, False]
    assert {(unit.width, unit.height) for unit in units} == {(320, 240)}
    assert [unit.time_s for unit in units] == [pytest.approx(100 + n / 30) for n in range(6)]
    assert far.transport.types == [102]
    assert far.transport.sent == []


async def test_a_viewer_in_the_middle_of_a_film_asks_for_a_keyframe_twice_a_second(
    clock: Clock,
) -> None:
    far = Far(clock)
    await far.send(pieces_of([FILM[1]] * 60))
    asked = far.asked(RtcpPsfbPacket)
    assert [(one.fmt, one.media_ssrc) for one in asked] == [(1, SSRC)] * 3
    assert far.units() == []


async def test_the_next_keyframe_is_requested_when_the_newest_one_is_old(clock: Clock) -> None:
    far = Far(clock)
    await far.send(pieces_of([FILM[0], *[FILM[1]] * 3], every_s=1.5))
    assert len(far.asked(RtcpPsfbPacket)) == 1
    assert len(far.units()) == 4


async def test_images_after_a_loss_wait_for_a_keyframe(clock: Clock) -> None:
    """The missing packets are requested first, then a keyframe."""
    far = Far(clock)
    pieces = pieces_of([FILM[0], FILM[1], FILM[1], FILM[1], FILM[0], FILM[1]], every_s=2 * WAIT_S)
    second = next(place for place, piece in enumerate(pieces) if piece.stamp != pieces[0].stamp)
    await far.send([*pieces[:second], *pieces[second + 1 :]])
    assert far.asked(RtcpRtpfbPacket)[0].lost == [pieces[second].number]
    assert len(far.asked(RtcpPsfbPacket)) >= 1
    assert [unit.is_key for unit in far.units()] == [True, True, False]


async def test_a_sender_report_makes_images_older_that_waited(clock: Clock) -> None:
    """Here, the fifth image comes a second later than its time stamp says."""
    far = Far(clock)
    pieces = pieces_of(FILM)
    await far.send([piece for piece in pieces if piece.came_s < 10.01])
    info = RtcpSenderInfo(3_900_000_000 << 32, pieces[0].stamp, 1, 1)
    await far.receiver._handle_rtcp_packet(RtcpSrPacket(SSRC, info))
    await far.receiver._handle_rtcp_packet(RtcpSrPacket(SSRC + 1, RtcpSenderInfo(1 << 32, 5, 1, 1)))
    rest = [piece for piece in pieces if piece.came_s > 10.01]
    await far.send([one._replace(came_s=one.came_s + (one.came_s > 10.12)) for one in rest])
    times = [unit.time_s for unit in far.units()]
    assert times == [pytest.approx(100 + n / 30, abs=1e-4) for n in range(6)]


async def test_reports_count_the_lost_packets(
    clock: Clock, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("urc.transports.whep_receiver.REPORT_S", 0.0)
    far = Far(clock)
    pieces = pieces_of(FILM[:1])
    await far.send([*pieces[:2], *pieces[3:]])
    info = RtcpSenderInfo(0x0000_1234_5678_0000, pieces[0].stamp, 1, 1)
    await far.receiver._handle_rtcp_packet(RtcpSrPacket(SSRC, info))
    clock.now_s += 0.5
    far.transport.has_sent.clear()
    running = asyncio.create_task(far.receiver.run())
    await far.transport.has_sent.wait()
    far.transport.close()
    with pytest.raises(VideoFault, match=f"^{ENDED}$"):
        await running
    (report,) = far.asked(RtcpRrPacket)[0].reports
    assert (report.ssrc, report.packets_lost) == (SSRC, 1)
    assert (report.lsr, report.dlsr) == (0x1234_5678, 32_768)


async def test_a_new_source_begins_with_its_keyframe(clock: Clock) -> None:
    far = Far(clock)
    await far.send(pieces_of(FILM[:2]))
    await far.send(pieces_of([FILM[1], FILM[0]]), ssrc=SSRC + 1)
    assert [unit.is_key for unit in far.units()] == [True, False, True]


@pytest.mark.parametrize("how", ["bye", "closed", "disconnect", "unsendable"])
async def test_the_end_of_the_stream_is_one_line(how: str, clock: Clock) -> None:
    far = Far(clock)
    await far.send(pieces_of(FILM[:1]))
    if how == "bye":
        await far.receiver._handle_rtcp_packet(RtcpByePacket([SSRC]))
    elif how == "closed":
        far.transport.close()
    elif how == "disconnect":
        far.receiver._handle_disconnect()
    else:
        far.transport.state = "closed"
        await far.send(pieces_of([FILM[1]] * 40, first=500))
    assert await far.reason() == ENDED


async def test_an_image_that_is_too_large_ends_the_stream(clock: Clock) -> None:
    far = Far(clock)
    part = bytes(4000)
    pieces = [RtpPiece(0, 0, False, b"\x67\x42\x00\x1e", 10.0)]
    pieces.append(RtpPiece(1, 0, False, b"\x7c\x85" + part, 10.0))
    count = MAX_UNIT_BYTES // len(part) + 2
    pieces += [RtpPiece(2 + n, 0, n == count - 1, b"\x7c\x05" + part, 10.0) for n in range(count)]
    pieces[-1] = pieces[-1]._replace(payload=b"\x7c\x45" + part)
    await far.send(pieces)
    assert (await far.reason()).startswith("an encoded image has 41")


# ICE


class Socket:
    """A socket of the library that keeps what would leave."""

    def __init__(self) -> None:
        self.sent: list[tuple[str, int]] = []

    def send_stun(self, message: Message, addr: tuple[str, int]) -> None:
        self.sent.append(addr)


async def test_checks_of_other_hosts_get_no_answer() -> None:
    """Even with the right password, which a hostile camera could hand out."""
    line = CameraLine(["192.168.1.5"], ["192.168.1.9"])
    check = Message(message_method=Method.BINDING, message_class=Class.REQUEST)
    check.attributes["USERNAME"] = f"{line.local_username}:far"
    check.attributes["PRIORITY"] = 1
    check.add_message_integrity(line.local_password.encode())
    socket = Socket()
    for host in ("192.168.1.6", "192.168.1.5"):
        line.request_received(check, (host, 9), cast(Any, socket))
    assert socket.sent == [("192.168.1.5", 9)]


async def test_waiting_datagrams_take_bounded_memory() -> None:
    line = CameraLine(["192.168.1.5"], ["192.168.1.9"])
    for data in (b"", bytes(5000), *(struct.pack(">I", number) for number in range(5000))):
        line.data_received(data, 1)
    assert line._queue.qsize() == 2000
    assert line._queue.get_nowait() == (bytes(4), 1)
