"""Cameras with WHEP: a server with the library aiortc, and servers that lie."""

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final

import httpx2
import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.certificates import Authority
from tests.e2e.transports.hostile import Talk, bounded, liar
from tests.e2e.transports.programs import listens, program
from tests.e2e.transports.test_camera import assert_in_order, left_readers, line, reason, unit
from urc.model.payload import Envelope
from urc.transports.base import ConnectFailed, Transport

SERVER: Final = str(Path(__file__).with_name("whep_server.py"))
TOKEN: Final = "t0ken"  # noqa: S105 - of the test's camera
PASSWORD: Final = "s3cret:x@"  # noqa: S105

pytestmark = [pytest.mark.anyio]


@asynccontextmanager
async def whep_server(*options: str, port: int = 0) -> AsyncIterator[tuple[int, int]]:
    """Run the server; give its port and its process."""
    port = port or free_port()
    async with program(sys.executable, SERVER, str(port), *options) as process:
        await listens(port)
        yield port, process.pid


def front(port: int) -> str:
    return f"whep://127.0.0.1:{port}/front/whep"


async def sessions(port: int) -> int:
    async with httpx2.AsyncClient() as client:
        return int((await client.get(f"http://127.0.0.1:{port}/sessions")).text)


async def assert_streams(eye: Transport, count: int = 45) -> None:
    """Images arrive, from a keyframe with parameter sets on."""
    units = [await unit(eye) for _ in range(count)]
    assert units[0].is_key
    assert {(one.width, one.height, one.codec[:5]) for one in units} == {(320, 240, "avc1.")}
    assert all(b"\0\0\1\x67" in one.data for one in units if one.is_key)
    times = [one.time_s for one in units]
    assert_in_order(times)
    assert abs(times[-1] - asyncio.get_running_loop().time()) < 2.0


async def test_a_stream_and_the_end_of_its_session() -> None:
    """The server learns that the session is over."""
    async with whep_server() as (port, _):
        async with line(url=front(port)) as eye:
            await assert_streams(eye)
            assert await sessions(port) == 1
        assert await sessions(port) == 0


async def test_a_long_stream_gets_keyframes() -> None:
    """The encoder sends none by itself, so URC asks for them."""
    async with whep_server() as (port, _), line(url=front(port)) as eye:
        units = [await unit(eye) for _ in range(200)]
    assert 2 <= sum(one.is_key for one in units) <= 4


@pytest.mark.parametrize("loss", ["2", "10"])
async def test_lost_packets_are_asked_for_again(loss: str) -> None:
    async with whep_server("--loss", loss) as (port, _), line(url=front(port)) as eye:
        await assert_streams(eye, 120)


@pytest.mark.parametrize(
    ("option", "auth"),
    [
        (("--token", TOKEN), {"type": "bearer", "token": TOKEN}),
        (
            ("--login", f"viewer:{PASSWORD}"),
            {"type": "basic", "user": "viewer", "password": PASSWORD},
        ),
    ],
    ids=["token", "password"],
)
async def test_sign_in(option: tuple[str, str], auth: dict[str, str]) -> None:
    """The session's end needs the sign-in too."""
    async with whep_server(*option) as (port, _):
        async with line(url=front(port), auth=auth) as eye:
            await assert_streams(eye, 5)
        assert await sessions(port) == 0
        async with line(url=front(port)) as eye:
            assert await reason(eye) == (
                "the server refuses the user name, the password or the token (status 401)"
            )


async def test_a_redirect_on_the_same_server_is_followed() -> None:
    async with (
        whep_server() as (port, _),
        line(url=f"whep://127.0.0.1:{port}/moved/whep") as eye,
    ):
        await assert_streams(eye, 5)


@pytest.mark.parametrize(
    ("path", "said"),
    [
        (
            "away/whep",
            "the server redirects to http://192.0.2.77/front/whep; URC sends only to"
            " 127.0.0.1:{port}: write that address as url if it is yours",
        ),
        (
            "none",
            "the server has no stream at this path of the url, or no source for it now"
            " (status 404)",
        ),
        (
            "sessions",
            "this path of the url accepts no offers, so it is not a WHEP address (status 405)",
        ),
    ],
)
async def test_a_wrong_path_is_one_line(path: str, said: str) -> None:
    async with whep_server() as (port, _), line(url=f"whep://127.0.0.1:{port}/{path}") as eye:
        assert await reason(eye) == said.format(port=port)


async def test_candidates_of_another_host_get_no_packet() -> None:
    async with whep_server("--candidates", "192.0.2.99") as (port, _), line(url=front(port)) as eye:
        told = await reason(eye)
    assert told.startswith("the server's answer names 192.0.2.99:")
    assert told.endswith(
        "but URC sends only to 127.0.0.1: add this address to the server's WebRTC addresses"
    )


async def test_another_certificate_than_the_answer_says() -> None:
    """As if somebody between the camera and URC had taken over the datagrams."""
    async with whep_server("--wrong-hash") as (port, _), line(url=front(port)) as eye:
        assert await reason(eye) == (
            "the server's certificate does not match the fingerprint in its answer"
        )


async def test_https(tmp_path: Path) -> None:
    authority = Authority(tmp_path)
    async with whep_server("--pair", *authority.sign("127.0.0.1")) as (port, _):
        url = front(port).replace("whep:", "wheps:")
        async with line(url=url, tls={"ca": authority.file}) as eye:
            await assert_streams(eye, 5)
        with pytest.raises(ConnectFailed, match=r"from an unknown authority; see tls\.ca$"):
            async with line(url=url):
                pass


async def test_ipv6() -> None:
    async with (
        whep_server("--host", "::1") as (port, _),
        line(url=f"whep://[::1]:{port}/front/whep") as eye,
    ):
        await assert_streams(eye, 5)


async def test_an_answer_without_h264() -> None:
    async with whep_server("--codec", "VP8") as (port, _), line(url=front(port)) as eye:
        assert await reason(eye) == (
            "the server sends neither H.264 nor H.265: select one of them in the camera's or"
            " server's settings"
        )


async def test_a_lost_server_and_its_return() -> None:
    async with whep_server() as (port, process), line(url=front(port)) as eye:
        await assert_streams(eye, 5)
        os.killpg(process, signal.SIGKILL)
        assert await reason(eye) == f"camera {front(port)} sent no image for 5 s"
        await eye.close()
        with pytest.raises(ConnectFailed, match=r"nothing listens on 127\.0\.0\.1"):
            await eye.open(10.0)
        async with whep_server(port=port):
            await eye.open(10.0)
            await assert_streams(eye, 5)
            await eye.close()


async def test_a_server_that_ends_the_session() -> None:
    """As MediaMTX does when the camera stops sending."""
    async with whep_server() as (port, process), line(url=front(port)) as eye:
        await assert_streams(eye, 5)
        os.kill(process, signal.SIGTERM)
        assert await reason(eye) in (
            "the camera ended the stream",
            f"camera {front(port)} sent no image for 5 s",
        )


async def test_a_pause_ends_the_session_and_a_viewer_begins_a_new_one() -> None:
    async with whep_server() as (port, _), line(url=front(port)) as eye:
        await assert_streams(eye, 5)
        waiting = asyncio.create_task(eye.receive())
        await eye.send(Envelope("unsubscribe", {"topic": ""}))
        assert await left_readers() == []
        assert await sessions(port) == 0
        await eye.send(Envelope("subscribe", {"topic": ""}))
        async with asyncio.timeout(30.0):
            assert await waiting
        assert await sessions(port) == 1


# Servers that lie


def answered(head: str, body: bytes = b"") -> Talk:
    """Answer each request with the same bytes."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while await reader.readuntil(b"\r\n\r\n"):
            writer.write(head.encode() + b"\r\n\r\n" + body)
            await writer.drain()

    return talk


async def endless(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    await reader.readuntil(b"\r\n\r\n")
    writer.write(b"HTTP/1.1 201 Created\r\nContent-Type: application/sdp\r\n\r\nv=0\r\n")
    while True:
        writer.write(b"a=candidate:1 1 udp 1 127.0.0.1 9 typ host\r\n" * 1000)
        await writer.drain()


CREATED: Final = "HTTP/1.1 201 Created\r\nContent-Type: application/sdp\r\nContent-Length: {}"
FULL: Final = (
    b"v=0\r\nm=video 9 UDP/TLS/RTP/SAVPF 102\r\na=rtpmap:102 H264/90000\r\na=rtcp-mux\r\n"
    b"a=setup:passive\r\na=ice-ufrag:abCD\r\na=ice-pwd:" + b"x" * 22 + b"\r\n"
    b"a=fingerprint:sha-256 AA:BB\r\na=candidate:1 1 udp 1 127.0.0.1 9 typ host\r\n"
)


async def heard(host: str) -> tuple[int, list[bytes], asyncio.DatagramTransport]:
    """Listen on an address; return the port, the datagrams so far, and the socket."""
    found: list[bytes] = []

    class Ear(asyncio.DatagramProtocol):
        def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
            found.append(data)

    loop = asyncio.get_running_loop()
    socket, _ = await loop.create_datagram_endpoint(Ear, local_addr=(host, 0))
    return socket.get_extra_info("sockname")[1], found, socket


async def test_only_the_host_in_the_document_gets_packets() -> None:
    """The answer names two addresses, and only one of them is the server's."""
    ours, to_server, first = await heard("127.0.0.1")
    theirs, to_other, second = await heard("127.0.0.2")
    line_of = "a=candidate:1 1 udp {} {} {} typ host\r\n"
    body = FULL.rpartition(b"a=candidate")[0]
    body += line_of.format(2, "127.0.0.2", theirs).encode()
    body += line_of.format(1, "127.0.0.1", ours).encode()
    try:
        async with (
            liar(answered(CREATED.format(len(body)), body)) as port,
            line(url=front(port)) as eye,
        ):
            told = await reason(eye)
    finally:
        first.close()
        second.close()
    assert told.startswith(f"no answer over UDP from 127.0.0.1 port {ours}: ")
    assert to_server
    assert to_other == []


@pytest.mark.parametrize(
    ("talk", "said"),
    [
        (endless, "the response is longer than 65536 bytes"),
        (
            answered(CREATED.format(10_000_000), b"v=0\r\n"),
            "the response is longer than 65536 bytes",
        ),
        (
            answered("HTTP/1.1 200 OK\r\nContent-Type: text/html\r\nContent-Length: 2", b"hi"),
            "the server answers with text/html instead of application/sdp: this path of the url is"
            " not a WHEP address",
        ),
        (
            answered("HTTP/1.1 406 No\r\nContent-Length: 2", b"hi"),
            "the server refuses the offer of H.264 and H.265 (status 406)",
        ),
        (
            answered("HTTP/1.1 500 Oops\r\nContent-Length: 9", b"why\nnot\n\n"),
            "the server refuses the offer: 500 Oops: why",
        ),
        (
            answered("HTTP/1.1 307 Moved\r\nLocation: /more\r\nContent-Length: 0"),
            "the server redirects more than 3 times",
        ),
        (
            answered(CREATED.format(len(FULL)), FULL),
            "no answer over UDP from 127.0.0.1 port 9: a firewall may block UDP, or the server has"
            " ended the session",
        ),
        (
            answered(CREATED.format(3), b"\xff\xfe\x00"),
            "the answer is not SDP, but begins with ",
        ),
    ],
)
async def test_a_hostile_answer_is_one_line(talk: Talk, said: str) -> None:
    with bounded(4_000_000):
        async with liar(talk) as port, line(url=front(port)) as eye:
            told = await reason(eye)
    assert told.startswith(said)


async def test_a_server_without_an_answer() -> None:
    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(-1)

    async with liar(talk) as port, line(url=front(port)) as eye:
        assert await reason(eye) == f"no answer from 127.0.0.1:{port} within 10 s"
