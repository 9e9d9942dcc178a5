"""SSH and Telnet servers that are none: what they ask, say and send stays bounded."""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress

import asyncssh
import pytest

from tests.e2e.transports.hostile import WAIT_S, bounded, ended, liar, turn_deaf
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.peers.ssh import HOST_KEY
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportSetup
from urc.transports.ssh import from_setup
from urc.transports.telnet import from_setup as telnet_from_setup

pytestmark = pytest.mark.anyio

_Process = asyncssh.SSHServerProcess


class _Server(asyncssh.SSHServer):
    """Lets everybody in, and keeps the connection at hand."""

    def __init__(self, made: list[asyncssh.SSHServerConnection]) -> None:
        self._made = made

    def connection_made(self, conn: asyncssh.SSHServerConnection) -> None:
        self._made.append(conn)

    def begin_auth(self, username: str) -> bool:
        return False


@asynccontextmanager
async def server(
    serve: Callable[..., object],
) -> AsyncIterator[tuple[int, list[asyncssh.SSHServerConnection]]]:
    """Run an SSH server whose programs are `serve`; give its port and its connections."""
    made: list[asyncssh.SSHServerConnection] = []
    acceptor = await asyncssh.listen(
        "127.0.0.1", 0, server_factory=lambda: _Server(made), server_host_keys=[HOST_KEY],
        process_factory=serve, encoding=None,
    )  # fmt: skip
    try:
        yield acceptor.get_port(), made
    finally:
        acceptor.close()
        for connection in made:
            connection.abort()
            with suppress(Exception):
                await connection.wait_closed()
        await acceptor.wait_closed()


@asynccontextmanager
async def line(port: int, **options: object) -> AsyncIterator[Transport]:
    """Open a shell, and see to it that nothing of it is left."""
    key = HOST_KEY.get_fingerprint()
    given = {"host": "127.0.0.1", "port": port, "username": "me", "host_key": key, "pty": False}
    transport = from_setup(TransportSetup("jump", given | options))
    try:
        await transport.open(20.0)
        yield transport
    finally:
        await transport.close()


async def test_complaints_without_end_are_not_kept() -> None:
    """Only the last words, and those in one line."""

    async def serve(process: "_Process[bytes]") -> None:
        for _ in range(2000):
            process.stderr.write(b"all is \x1b[31mlost\r" * 500)
            await process.stderr.drain()
        process.stderr.write(b"bye\x07\x1b[2J")
        process.exit(3)

    async with server(serve) as (port, _), line(port) as transport:
        with bounded(20_000_000):
            assert "status 3" in await ended(transport)


async def test_good_bye_of_many_lines_is_told_in_one() -> None:
    """Whatever the server gives as its reason."""

    async def serve(process: "_Process[bytes]") -> None:
        connection = process.channel.get_connection()
        connection._send_disconnect(2, "Go\x1b[31m away\nfatal: " + "x" * 10_000, "")
        await asyncio.sleep(60)

    async with server(serve) as (port, _), line(port) as transport:
        assert "away fatal" in await ended(transport)


async def test_channels_from_the_server_are_refused() -> None:
    """Nobody comes in through the back."""

    async def serve(process: "_Process[bytes]") -> None:
        connection = process.channel.get_connection()
        refused = 0
        for _ in range(20):
            try:
                await connection.create_connection(asyncssh.SSHTCPSession, "127.0.0.1", 22)
            except asyncssh.ChannelOpenError:
                refused += 1
        process.stdout.write(b"%d refused\n" % refused)
        await process.stdout.drain()
        process.exit(0)

    async with server(serve) as (port, _), line(port) as transport:
        async with asyncio.timeout(WAIT_S):
            assert await transport.receive() == b"20 refused\n"


@pytest.mark.parametrize(
    "said",
    [
        b"SSH-2.0-x\r\n" + bytes(100_000),
        b"x" * 100_000,
        b"no\x1b[2J SSH\r\n" * 5000,
        b"SSH-2.0-\xff\xfe\r\n",
    ],
)
async def test_what_is_no_ssh_server_is_told_in_one_line(said: bytes) -> None:
    """Within the time there is for it."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(said)
        await reader.read()

    async with liar(talk) as port, nothing_left():
        with pytest.raises(ConnectFailed) as raised:
            async with line(port):
                pass
        assert str(raised.value).isprintable()
        del raised


@pytest.mark.parametrize(
    "storm",
    [b"\xff\xfd\x18" * 20_000, b"\xff\xfd\x1f\xff\xfe\x1f" * 10_000,
     b"\xff\xfa\x18\x01\xff\xf0" * 10_000,
     b"\xff\xfa" + b"x" * 60_000, b"\xff\xfd\x2a" * 20_000],
)  # fmt: skip
async def test_options_without_end_and_no_ear_fill_nothing(storm: bytes) -> None:
    """The answers wait for the robot to take them, and it is not read meanwhile."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        turn_deaf(writer)
        writer.write(b"\xff\xfd\x18")
        while True:
            writer.write(storm)
            await writer.drain()

    async with liar(talk) as port, nothing_left():
        transport = telnet_from_setup(TransportSetup("wire", {"host": "127.0.0.1", "port": port}))
        await transport.open(20.0)
        with bounded(20_000_000), suppress(TimeoutError, PeerClosed):
            async with asyncio.timeout(1.5):
                await transport.receive()
        await transport.close()
        del transport
