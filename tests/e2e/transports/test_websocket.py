"""WebSocket against websocketd, which URC's authors did not write: a program behind each socket."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.certificates import Authority
from tests.e2e.transports.detour import Detour
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.programs import listens, program
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportError, TransportSetup
from urc.transports.websocket import from_setup

WAIT_S = 20.0

pytestmark = [pytest.mark.anyio, pytest.mark.needs("websocketd")]


@asynccontextmanager
async def robot(*command: str, options: tuple[str, ...] = ()) -> AsyncIterator[int]:
    """Run websocketd with a program for each client; give its port."""
    port = free_port()
    place = [f"--port={port}", "--address=127.0.0.1", "--loglevel=error"]
    async with program("websocketd", *place, *options, *command):
        await listens(port)
        yield port


@asynccontextmanager
async def line(port: int, scheme: str = "ws", **options: object) -> AsyncIterator[Transport]:
    """Open a line to a port of loopback, and see to it that nothing of it is left."""
    options = {"url": f"{scheme}://127.0.0.1:{port}/robot?speed=1", **options}
    async with nothing_left():
        transport = from_setup(TransportSetup("socket", options))
        try:
            await transport.open(20.0)
            yield transport
        finally:
            await transport.close()
            del transport


async def received(transport: Transport) -> object:
    async with asyncio.timeout(WAIT_S):
        return await transport.receive()


async def test_each_message_is_a_payload() -> None:
    """Text goes out and comes back as its UTF-8 bytes, one message at a time."""
    async with robot("cat") as port, line(port) as transport:
        for text in ("Give me the battery %", "ä" * 1000, "x"):
            await transport.send(text.encode())
            assert await received(transport) == text.encode()


async def test_binary_messages_are_bytes() -> None:
    """Any byte goes out and comes back."""
    binary = robot("cat", options=("--binary",))
    async with binary as port, line(port, send_as="binary") as transport:
        data = bytes(range(256))
        await transport.send(data)
        assert await received(transport) == data


async def test_text_must_be_text() -> None:
    """Bytes that are no UTF-8 are refused before they are sent, and the line stands."""
    async with robot("cat") as port, line(port) as transport:
        with pytest.raises(TransportError, match="use send_as: binary"):
            await transport.send(b"\xff")
        await transport.send(b"on")
        assert await received(transport) == b"on"


async def test_robot_sees_path_and_headers() -> None:
    """The query, a header of the document's, and who we are."""
    script = 'echo "$PATH_INFO $QUERY_STRING $HTTP_X_ROBOT $HTTP_AUTHORIZATION"; cat'
    auth = {"type": "basic", "user": "operator", "password": "s3cret"}
    headers = {"X-Robot": "arm"}
    async with (
        robot("sh", "-c", script) as port,
        line(port, auth=auth, headers=headers) as transport,
    ):
        seen = await received(transport)
    assert seen == b"/robot speed=1 arm Basic b3BlcmF0b3I6czNjcmV0"


async def test_robot_that_ends_closes_the_line() -> None:
    """What it said before still arrives."""
    async with robot("sh", "-c", "echo one; echo two") as port, line(port) as transport:
        assert await received(transport) == b"one"
        assert await received(transport) == b"two"
        with pytest.raises(PeerClosed, match="the robot closed the connection"):
            await received(transport)
        with pytest.raises(PeerClosed, match="the robot closed the connection"):
            await transport.send(b"three")


async def test_message_that_is_too_long_ends_the_line() -> None:
    """It is not taken, and the reason says so."""
    script = "head -c 5000 /dev/zero | tr '\\0' x; echo; cat"
    async with robot("sh", "-c", script) as port, line(port, max_message=4096) as transport:
        with pytest.raises(PeerClosed, match=r"the robot sent invalid data \(1009 "):
            await received(transport)


async def test_flood_waits_until_it_is_taken() -> None:
    """Nothing is lost and nothing is stored: the robot is not read meanwhile."""
    async with robot("seq", "1", "200000") as port, line(port) as transport:
        await asyncio.sleep(0.5)
        for number in range(1, 5001):
            assert await received(transport) == str(number).encode()


async def test_secure_line(tmp_path_factory: pytest.TempPathFactory) -> None:
    """The certificate is checked, and then all is as without TLS."""
    authority = Authority(tmp_path_factory.mktemp("authority"))
    pair = authority.sign("127.0.0.1")
    options = ("--ssl", f"--sslcert={pair.cert}", f"--sslkey={pair.key}")
    async with robot("cat", options=options) as port:
        with pytest.raises(ConnectFailed, match="unknown authority"):
            async with line(port, "wss"):
                pass
        async with line(port, "wss", tls={"ca": authority.file}) as transport:
            for _ in range(20):
                await transport.send(b"on")
                assert await received(transport) == b"on"


@pytest.mark.needs("lighttpd")
async def test_server_that_is_no_websocket(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A web server answers something else, and where it sends us is not followed."""
    from tests.e2e.transports.web import lighttpd

    web = lighttpd(tmp_path_factory.mktemp("web"))
    await web.start()
    place = f"127.0.0.1:{web.port}"
    try:
        with pytest.raises(ConnectFailed) as told:
            async with line(web.port, url=f"ws://{place}/missing"):
                pass
        assert str(told.value) == f"{place} answered 404 Not Found instead of opening a WebSocket"
        with pytest.raises(ConnectFailed) as told:
            async with line(web.port, url=f"ws://{place}/moved"):
                pass
        target = "http://127.0.0.1:1/elsewhere"
        assert str(told.value) == f"the robot redirected to {target}; redirects are not followed"
    finally:
        web.kill()


@pytest.mark.needs("socat")
async def test_server_that_does_not_speak_http() -> None:
    """It is told apart from one that is not there."""
    port = free_port()
    place = f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork"
    async with program("socat", place, "SYSTEM:echo hello robot"):
        await listens(port)
        with pytest.raises(ConnectFailed, match="does not speak HTTP"):
            async with line(port):
                pass


async def test_line_through_another_transport() -> None:
    """The far end of the carrier knows the name; nothing is left when either side ends."""
    async with robot("cat") as port, nothing_left():
        url = "ws://robot.inside:8765/robot"
        transport = from_setup(TransportSetup("socket", {"url": url}, tunnel=Detour(port)))
        for _ in range(2):
            await transport.open(20.0)
            for _ in range(3):
                await transport.send(b"x" * 10_000)
                assert await received(transport) == b"x" * 10_000
            await transport.close()
        del transport
