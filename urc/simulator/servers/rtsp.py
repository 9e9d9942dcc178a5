"""An emulated camera with RTSP: its images in RTP, on the same connection or as datagrams.

Each connection has at most one session, which ends with the connection. Sources: RFC 2326 (RTSP),
RFC 8866 (SDP) and RFC 6184, 8.2 (SDP of H.264).
"""

import asyncio
import re
import secrets
import socket
from collections.abc import Mapping
from contextlib import suppress
from typing import Final, NamedTuple, Protocol
from urllib.parse import unquote, urlsplit

from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.camera_images import CameraImages
from urc.simulator.servers.clients import TAKEN_WITHIN_S, ClientConnection
from urc.simulator.servers.http_auth import HttpAuth
from urc.simulator.servers.listening import StreamServer, UrlServer
from urc.simulator.servers.rtp import CLOCK_HZ, PAYLOAD_TYPE, RtpStream
from urc.simulator.servers.video_encoder import EncodedUnit

__all__ = ["RtspServer"]

MAX_HEAD_BYTES: Final = 16_384
MAX_WAITING_BYTES: Final = 1_048_576
"""Bytes that may wait for a slow client; then images are dropped up to the next keyframe."""
REPORT_EVERY_S: Final = 5.0
_TRACK: Final = "video"
_CLIENT_PORTS: Final = re.compile(r"client_port=([0-9]{1,5})-([0-9]{1,5})")
_CHANNELS: Final = re.compile(r"interleaved=([0-9]{1,3})-([0-9]{1,3})")
_LENGTH: Final = re.compile(r"[0-9]{1,5}")
_METHODS: Final = "OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN, GET_PARAMETER"
_REASONS: Final = {
    200: "OK",
    400: "Bad Request",
    401: "Unauthorized",
    404: "Not Found",
    454: "Session Not Found",
    455: "Method Not Valid in This State",
    461: "Unsupported Transport",
    501: "Not Implemented",
}


class RtspServer(UrlServer, StreamServer):
    """A camera behind an RTSP server."""

    SCHEME = "rtsp"
    URL_PORT = 554

    def __init__(self, context: ServerContext, images: CameraImages) -> None:
        super().__init__(context)
        self._images = images
        self._auth = HttpAuth(context.options.get("auth"))

    async def _talk(
        self,
        client: ClientConnection,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        writer.transport.set_write_buffer_limits(high=MAX_WAITING_BYTES)
        path = self._path.rstrip("/")
        await _RtspConversation(self._context, self._auth, path, writer).run(
            client, reader, self._images
        )


class _Request(NamedTuple):
    method: str
    """Method in capital letters; "" for an invalid request."""
    target: str
    """Target as received."""
    path: str
    """Decoded path of the target, without a slash at the end."""
    headers: Mapping[str, str]


_INVALID: Final = _Request("", "", "", {})


class _Answer(NamedTuple):
    status: int
    headers: tuple[tuple[str, str], ...] = ()
    body: bytes = b""


class _RtspConversation:
    """Answers the requests of one connection in turn."""

    def __init__(
        self, context: ServerContext, auth: HttpAuth, path: str, writer: asyncio.StreamWriter
    ) -> None:
        self._context = context
        self._auth = auth
        self._path = path
        self._writer = writer
        self._receiver: RtpReceiver | None = None
        self._session = secrets.token_hex(8)

    async def run(
        self, client: ClientConnection, reader: asyncio.StreamReader, images: CameraImages
    ) -> None:
        try:
            while (asked := await _next(reader)) is not None:
                client.active_s = asyncio.get_running_loop().time()
                answer = self._answer(asked)
                self._write(answer, asked.headers.get("cseq", "0"))
                if asked.method == "PLAY" and answer.status == 200 and self._receiver is not None:
                    images.receivers.add(self._receiver)
                if asked.method == "TEARDOWN" or answer.status == 400:
                    break
                async with asyncio.timeout(TAKEN_WITHIN_S):
                    await self._writer.drain()
        finally:
            if self._receiver is not None:
                images.receivers.discard(self._receiver)
                self._receiver.close()
        self._writer.close()
        async with asyncio.timeout(TAKEN_WITHIN_S):
            await self._writer.wait_closed()

    def _answer(self, asked: _Request) -> _Answer:
        if not asked.method:
            return _Answer(400)
        if asked.method == "OPTIONS":
            return _Answer(200, (("Public", _METHODS),))
        given = asked.headers.get("authorization", "")
        challenge = self._auth.challenge(asked.method, asked.target, given)
        if challenge is not None:
            return _Answer(401, (("WWW-Authenticate", challenge),))
        if asked.path not in (self._path, f"{self._path}/{_TRACK}"):
            return _Answer(404)
        if asked.method == "DESCRIBE":
            return self._description(asked)
        if asked.method == "SETUP":
            return self._set_up(asked)
        if asked.method not in _METHODS.split(", "):
            return _Answer(501)
        if asked.headers.get("session", "").partition(";")[0] not in ("", self._session):
            return _Answer(454)
        if asked.method == "PLAY" and self._receiver is None:
            return _Answer(455)
        return _Answer(200, (("Session", self._session),))

    def _description(self, asked: _Request) -> _Answer:
        lines = (
            *("v=0", "o=- 0 0 IN IP4 0.0.0.0", "s=emulated camera", "c=IN IP4 0.0.0.0", "t=0 0"),
            *("a=control:*", f"m=video 0 RTP/AVP {PAYLOAD_TYPE}"),
            f"a=rtpmap:{PAYLOAD_TYPE} H264/{CLOCK_HZ}",
            f"a=fmtp:{PAYLOAD_TYPE} packetization-mode=1",
            f"a=control:{_TRACK}",
        )
        body = "".join(f"{line}\r\n" for line in lines).encode()
        base = f"{asked.target.rstrip('/')}/"
        return _Answer(200, (("Content-Type", "application/sdp"), ("Content-Base", base)), body)

    def _set_up(self, asked: _Request) -> _Answer:
        """Prepare the first transport of the client's list that is possible."""
        if self._receiver is not None:
            return _Answer(455)
        for one in asked.headers.get("transport", "").split(","):
            way = self._way(one.strip())
            if way is None:
                continue
            put, transport = way
            self._receiver = RtpReceiver(self._context, put)
            return _Answer(200, (("Transport", transport), ("Session", self._session)))
        return _Answer(461)

    def _way(self, wanted: str) -> "tuple[RtpWay, str] | None":
        profile = wanted.partition(";")[0].upper()
        channels, ports = _CHANNELS.search(wanted), _CLIENT_PORTS.search(wanted)
        if profile == "RTP/AVP/TCP":
            first, second = (int(channels[1]), int(channels[2])) if channels else (0, 1)
            if max(first, second) > 255:
                return None
            way = _InterleavedWay(self._writer, first, second)
            return way, f"RTP/AVP/TCP;unicast;interleaved={first}-{second}"
        if profile in ("RTP/AVP", "RTP/AVP/UDP") and ports and "multicast" not in wanted:
            try:
                datagrams = _DatagramWay(self._writer, int(ports[1]), int(ports[2]))
            except (OSError, OverflowError):
                return None
            server = "-".join(map(str, datagrams.ports))
            return datagrams, f"RTP/AVP;unicast;{ports[0]};server_port={server}"
        return None

    def _write(self, answer: _Answer, number: str) -> None:
        head = [f"RTSP/1.0 {answer.status} {_REASONS[answer.status]}", f"CSeq: {number}"]
        head += [f"{name}: {value}" for name, value in answer.headers]
        if answer.body:
            head.append(f"Content-Length: {len(answer.body)}")
        self._writer.write("\r\n".join([*head, "", ""]).encode() + answer.body)


class RtpWay(Protocol):
    """The way of packets to one client."""

    def is_free(self) -> bool:
        """Return whether little data waits for the client."""

    def put(self, data: bytes, *, is_report: bool) -> None:
        """Send a packet of RTP, or a report of RTCP, without waiting."""

    def close(self) -> None:
        """Release all sockets."""


class RtpReceiver:
    """A client that receives a camera's images in RTP."""

    def __init__(self, context: ServerContext, way: RtpWay) -> None:
        self.needs_key = True
        self._context = context
        self._way = way
        self._stream = RtpStream(secrets.randbits(32), secrets.randbits(16))
        self._line = context.line()
        self._reported_s = float("-inf")

    def is_ready(self) -> bool:
        """Return whether the client keeps up; otherwise it continues with a keyframe."""
        self.needs_key = self.needs_key or not self._way.is_free()
        return self._way.is_free()

    def take(self, image: EncodedUnit) -> None:
        """Send an image, after the injected delay."""
        time_s = self._context.now()
        if self._line.delay_s:
            loop = asyncio.get_running_loop()
            loop.call_later(self._line.delay_s, self._send, image.data, time_s)
        else:
            self._send(image.data, time_s)

    def close(self) -> None:
        """Release the sockets of datagrams."""
        self._way.close()

    def _send(self, data: bytes, time_s: float) -> None:
        if time_s - self._reported_s >= REPORT_EVERY_S:
            self._reported_s = time_s
            self._way.put(self._stream.report(time_s), is_report=True)
        for packet in self._stream.packets(data, time_s):
            self._way.put(packet, is_report=False)


class _InterleavedWay:
    """The RTSP connection itself (RFC 2326, 10.12)."""

    def __init__(self, writer: asyncio.StreamWriter, packets: int, reports: int) -> None:
        self._writer = writer
        self._channels = packets, reports

    def is_free(self) -> bool:
        return self._writer.transport.get_write_buffer_size() < MAX_WAITING_BYTES // 2

    def put(self, data: bytes, *, is_report: bool) -> None:
        head = bytes((ord("$"), self._channels[is_report])) + len(data).to_bytes(2, "big")
        if not self._writer.is_closing():
            self._writer.write(head + data)

    def close(self) -> None:
        """The connection closes by itself."""


class _DatagramWay:
    """A pair of UDP ports, from which packets reach only the client of the connection."""

    def __init__(self, writer: asyncio.StreamWriter, packets: int, reports: int) -> None:
        host, peer = writer.get_extra_info("sockname")[0], writer.get_extra_info("peername")[0]
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        self._sockets: list[socket.socket] = []
        self.ports: list[int] = []
        try:
            for port in (packets, reports):
                one = socket.socket(family, socket.SOCK_DGRAM)
                self._sockets.append(one)
                one.setblocking(False)
                one.bind((host, 0))
                one.connect((peer, port))
                self.ports.append(one.getsockname()[1])
        except (OSError, OverflowError):
            self.close()
            raise

    def is_free(self) -> bool:
        return True

    def put(self, data: bytes, *, is_report: bool) -> None:
        with suppress(OSError):  # lost, as datagrams may be
            self._sockets[is_report].send(data)

    def close(self) -> None:
        for one in self._sockets:
            one.close()


async def _next(reader: asyncio.StreamReader) -> _Request | None:
    """Return the next request; None at the end of the connection.

    Reports of the client between the requests are skipped. A request without a method is invalid.
    """
    head = bytearray()
    while not head.endswith(b"\r\n\r\n"):
        try:
            piece = await reader.readline() if head else await reader.read(1)
        except ValueError:  # a line that exceeds the limit of the reader
            return _INVALID
        if not piece:
            return None
        if piece == b"$" and not head:
            with suppress(asyncio.IncompleteReadError):
                size = int.from_bytes((await reader.readexactly(3))[1:], "big")
                await reader.readexactly(size)
            continue
        head += piece if head else piece.strip()  # lines may be empty between requests
        if len(head) > MAX_HEAD_BYTES:
            return _INVALID
    return await _parsed(bytes(head), reader)


async def _parsed(head: bytes, reader: asyncio.StreamReader) -> _Request:
    first, *lines = head.decode("latin-1").split("\r\n")
    words = first.split(" ")
    headers = {}
    for line in lines:
        name, colon, value = line.partition(":")
        if colon:
            headers[name.strip().lower()] = value.strip()
    length = headers.get("content-length", "0")
    if len(words) != 3 or not words[2].startswith("RTSP/1.") or not _LENGTH.fullmatch(length):
        return _INVALID
    try:
        path = unquote(urlsplit(words[1]).path).rstrip("/")
    except ValueError:
        return _INVALID
    with suppress(asyncio.IncompleteReadError):
        await reader.readexactly(int(length))
    return _Request(words[0].upper(), words[1], path, headers)
