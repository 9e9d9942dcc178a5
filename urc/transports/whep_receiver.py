"""The receiver of WHEP: offer, ICE, DTLS and RTP, until encoded images are complete.

Only the process of a camera imports this module. The libraries `aioice` and `aiortc` connect,
encrypt and parse. The library's own receiver would decode the images, and would show images with
lost packets; this receiver does neither. It sends three kinds of RTCP packets: reports, requests
for lost packets, and requests for a keyframe.
"""

import asyncio
import json
import math
import secrets
import threading
import time
from collections.abc import Callable
from typing import Final

from aiortc import RTCCertificate, RTCDtlsFingerprint, RTCDtlsParameters, RTCDtlsTransport
from aiortc.rtcrtpparameters import RTCRtpCodecParameters, RTCRtpReceiveParameters
from aiortc.rtcrtpreceiver import StreamStatistics
from aiortc.rtp import (
    RTCP_PSFB_PLI,
    RTCP_RTPFB_NACK,
    AnyRtcpPacket,
    RtcpByePacket,
    RtcpPsfbPacket,
    RtcpReceiverInfo,
    RtcpRrPacket,
    RtcpRtpfbPacket,
    RtcpSrPacket,
    RtpPacket,
)

from urc.transports.camera_records import OFFER, CapturedUnits, DemuxJob, UnitQueue, put_units
from urc.transports.camera_records import record_of as record
from urc.transports.rtp_assembler import RtpAssembler, RtpImage, RtpPiece
from urc.transports.sender_clock import SenderClock
from urc.transports.whep_line import CameraLine, DatagramLine
from urc.transports.whep_sdp import IceHost, WhepAnswer, offer_text
from urc.video_reader import UnitReader, VideoFault

__all__ = ["read_whep"]

RATE_HZ: Final = 90_000
HANDSHAKE_S: Final = 5.0
"""Maximum time for the DTLS handshake, in seconds."""
REPORT_S: Final = 1.0
ASK_KEY_S: Final = 0.5
"""Minimum time between two requests for a keyframe, in seconds."""
KEY_EVERY_S: Final = 4.0
"""Age of the newest keyframe at which the next one is requested, in seconds. WebRTC servers often
send none by themselves, and a new page starts with the newest keyframe."""
ASK_LOST_S: Final = 0.05
"""Minimum time between two requests for lost packets, in seconds."""
ENDED: Final = "the camera ended the stream"


def read_whep(
    job: DemuxJob,
    next_line: Callable[[], bytes],
    end_with_input: Callable[[], None],
    queue: UnitQueue,
) -> None:
    """Receive a stream until its end, and put its access units into a queue.

    Args:
        job: the addresses of both ends.
        next_line: wait for the answer, as the JSON of a `WhepAnswer`.
        end_with_input: end this process with the server's process; called in a thread.
        queue: target of the offer and of the access units.

    Raises:
        VideoFault: the stream ended or cannot be used.
    """
    asyncio.run(_received(job, next_line, end_with_input, queue))


async def _received(
    job: DemuxJob,
    next_line: Callable[[], bytes],
    end_with_input: Callable[[], None],
    queue: UnitQueue,
) -> None:
    line = CameraLine(job.hosts, job.own_hosts)
    await line.gather_candidates()
    if not line.local_candidates:
        raise VideoFault(f"no socket for UDP at {', '.join(job.own_hosts)}")
    certificate = RTCCertificate.generateCertificate()
    transport = RTCDtlsTransport(DatagramLine(line), [certificate])  # type: ignore[arg-type] # duck
    own = [(one.algorithm, one.value) for one in certificate.getFingerprints()]
    offer = offer_text(
        user=line.local_username,
        password=line.local_password,
        fingerprints=[one for one in own if one[0] == "sha-256"],
        candidates=[one.to_sdp() for one in line.local_candidates],
    )
    queue.tell(record(OFFER, offer.encode()))
    answer = await _answered(next_line, end_with_input)
    receiver = WhepReceiver(transport, answer, queue)
    try:
        await line.reach(answer)
        await _encrypt(transport, answer)
        await receiver.run()
    finally:
        await transport.stop()
        await line.close()


async def _answered(
    next_line: Callable[[], bytes], end_with_input: Callable[[], None]
) -> WhepAnswer:
    """Wait for the answer in a thread, because Windows has no other way to read a pipe."""
    loop = asyncio.get_running_loop()
    found: asyncio.Future[bytes] = loop.create_future()

    def read() -> None:
        line = next_line()
        if line:
            loop.call_soon_threadsafe(found.set_result, line)
        end_with_input()

    threading.Thread(target=read, daemon=True).start()
    given = json.loads(await found)
    hosts = tuple(IceHost(*host) for host in given.pop("hosts"))
    return WhepAnswer(**given, hosts=hosts)


async def _encrypt(transport: RTCDtlsTransport, answer: WhepAnswer) -> None:
    transport._set_role("server" if answer.starts_tls else "client")  # noqa: SLF001 - docs/decisions/0076
    fingerprints = [RTCDtlsFingerprint(name, value) for name, value in answer.fingerprints]
    try:
        async with asyncio.timeout(HANDSHAKE_S):
            await transport.start(RTCDtlsParameters(fingerprints=fingerprints))
    except TimeoutError as fault:
        raise VideoFault("the server did not answer the DTLS handshake") from fault
    if transport.state == "connected":
        return
    if transport.encrypted:
        raise VideoFault("the server's certificate does not match the fingerprint in its answer")
    raise VideoFault("the DTLS handshake with the server failed")


class WhepReceiver:
    """A receiver of one video, with the methods that the library's DTLS transport calls."""

    def __init__(self, transport: RTCDtlsTransport, answer: WhepAnswer, queue: UnitQueue) -> None:
        """Register at `transport` for the payload types of `answer`."""
        self._transport = transport
        self._queue = queue
        self._codecs = dict(answer.codecs)
        self._ssrc = secrets.randbits(32)
        self._stream: _Stream | None = None
        self._over: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        parameters = RTCRtpReceiveParameters(
            codecs=[
                RTCRtpCodecParameters(
                    mimeType="video/H265" if is_hevc else "video/H264",
                    clockRate=RATE_HZ,
                    payloadType=number,
                )
                for number, is_hevc in answer.codecs
            ]
        )
        transport._register_rtp_receiver(self, parameters)  # noqa: SLF001 - docs/decisions/0076
        transport.on("statechange", self._watch)

    async def run(self) -> None:
        """Send reports until the stream ends.

        Raises:
            VideoFault: the stream ended or cannot be used.
        """
        while not self._over.done():
            await asyncio.wait((self._over,), timeout=REPORT_S)
            if self._stream is not None and not self._over.done():
                await self._send(self._stream.report(self._ssrc))
                await self._ask(self._stream, time.monotonic())
        self._over.result()

    def _watch(self) -> None:
        if self._transport.state == "closed":
            self._end(VideoFault(ENDED))

    def _end(self, fault: Exception) -> None:
        if not self._over.done():
            self._over.set_exception(fault)

    # -- called by the library

    def _handle_disconnect(self) -> None:
        self._end(VideoFault(ENDED))

    async def _handle_rtcp_packet(self, packet: AnyRtcpPacket) -> None:
        stream = self._stream
        if isinstance(packet, RtcpByePacket):
            self._end(VideoFault(ENDED))
        elif isinstance(packet, RtcpSrPacket) and stream and packet.ssrc == stream.ssrc:
            stream.hear(packet, time.monotonic())

    async def _handle_rtp_packet(self, packet: RtpPacket, arrival_time_ms: int) -> None:
        now_s = time.monotonic()
        try:
            if self._stream is None or self._stream.ssrc != packet.ssrc:
                is_hevc = self._codecs[packet.payload_type]
                self._stream = _Stream(packet.ssrc, is_hevc=is_hevc, now_s=now_s)
            self._stream.take(packet, now_s, self._queue)
            await self._ask(self._stream, now_s)
        except Exception as fault:  # supervisor: the library would only log it
            self._end(fault)

    # -- RTCP

    async def _ask(self, stream: "_Stream", now_s: float) -> None:
        """Ask for a keyframe and for lost packets, if they are needed."""
        if stream.wants_key(now_s):
            await self._send(RtcpPsfbPacket(RTCP_PSFB_PLI, self._ssrc, stream.ssrc))
        if lost := stream.lost(now_s):
            await self._send(RtcpRtpfbPacket(RTCP_RTPFB_NACK, self._ssrc, stream.ssrc, lost))

    async def _send(self, packet: AnyRtcpPacket) -> None:
        try:
            await self._transport._send_rtp(bytes(packet))  # noqa: SLF001 - docs/decisions/0076
        except ConnectionError:
            self._end(VideoFault(ENDED))


class _Stream:
    """The packets of one source, and what the sender must be asked for."""

    def __init__(self, ssrc: int, *, is_hevc: bool, now_s: float) -> None:
        self.ssrc = ssrc
        """Number of the source (RFC 3550)."""
        self._assembler = RtpAssembler(is_hevc=is_hevc)
        self._reader = UnitReader(is_hevc=is_hevc, began_s=now_s)
        self._clock = SenderClock(RATE_HZ)
        self._captured = CapturedUnits()
        self._statistics = StreamStatistics(RATE_HZ)
        self._waits_for_key = True
        self._key_s = now_s
        """Arrival of the newest keyframe."""
        self._asked_key_s = now_s  # the first image is often a keyframe
        self._asked_lost_s = -math.inf
        self._report: tuple[int, float] = (0, now_s)
        """Middle of the newest sender report's time, and the report's arrival."""

    def take(self, packet: RtpPacket, now_s: float, queue: UnitQueue) -> None:
        self._statistics.add(packet)
        piece = RtpPiece(
            packet.sequence_number, packet.timestamp, bool(packet.marker), packet.payload, now_s
        )
        for image in self._assembler.add(piece):
            self._pass_on(image, queue)

    def _pass_on(self, image: RtpImage, queue: UnitQueue) -> None:
        unit = self._reader.unit(image.data, image.came_s)
        if image.is_after_loss and not self._waits_for_key:
            self._waits_for_key, self._asked_key_s = True, -math.inf
        if unit is None or (self._waits_for_key and not unit.is_key):
            return
        self._waits_for_key = False
        if unit.is_key:
            self._key_s = image.came_s
        unit = self._captured.aged(unit, self._clock.captured_s(image.stamp), queue)
        put_units([unit], queue)

    def hear(self, packet: RtcpSrPacket, now_s: float) -> None:
        """Take the clock and the time from a sender report."""
        info = packet.sender_info
        self._clock.hear(info.ntp_timestamp, info.rtp_timestamp)
        self._report = info.ntp_timestamp >> 16 & 0xFFFFFFFF, now_s

    def report(self, ssrc: int) -> RtcpRrPacket:
        """Return a receiver report (RFC 3550, 6.4.2)."""
        found, (middle, heard_s) = self._statistics, self._report
        delay = min(int((time.monotonic() - heard_s) * 65536), 0xFFFFFFFF) if middle else 0
        info = RtcpReceiverInfo(
            ssrc=self.ssrc,
            fraction_lost=min(found.fraction_lost, 255),
            packets_lost=found.packets_lost,
            highest_sequence=found.cycles + (found.max_seq or 0) & 0xFFFFFFFF,
            jitter=found.jitter & 0xFFFFFFFF,
            lsr=middle,
            dlsr=delay,
        )
        return RtcpRrPacket(ssrc, [info])

    def wants_key(self, now_s: float) -> bool:
        """Return whether to ask for a keyframe now."""
        is_needed = self._waits_for_key or now_s - self._key_s > KEY_EVERY_S
        if not is_needed or now_s - self._asked_key_s < ASK_KEY_S:
            return False
        self._asked_key_s = now_s
        return True

    def lost(self, now_s: float) -> list[int]:
        """Return the numbers of the packets to ask for now."""
        missing = self._assembler.missing()
        if not missing or now_s - self._asked_lost_s < ASK_LOST_S:
            return []
        self._asked_lost_s = now_s
        return missing
