"""Where a process cannot inherit a pipe the guard comes to a door, and nobody else is let in."""

import asyncio
import socket
import subprocess
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from functools import partial

import pytest

from urc.guard import messages
from urc.guard.channel import GuardedLineSpec
from urc.guard.guard_client import GuardClient, HeldSpec
from urc.guard.pipe_channel import PipeChannel
from urc.guard.process import GuardAcceptor
from urc.motion.hold_to_run import HoldTerms
from urc.transports.tcp import TcpTransport

pytestmark = pytest.mark.anyio

STOP = b"stop\n"
BOUND_S = 30.0


class Robot:
    """Keeps what it hears."""

    def __init__(self) -> None:
        self.heard = b""
        self._news = asyncio.Condition()

    async def listen(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Be one connection."""
        with suppress(ConnectionError):
            while data := await reader.read(4096):
                async with self._news:
                    self.heard += data
                    self._news.notify_all()
        writer.close()

    async def hears(self, text: bytes) -> None:
        """Return when the last thing that it heard is `text`."""
        async with asyncio.timeout(BOUND_S), self._news:
            await self._news.wait_for(lambda: self.heard.endswith(text))


@asynccontextmanager
async def guarded() -> AsyncIterator[tuple[GuardClient, Robot]]:
    """Run a guard that came to its door, and a robot."""
    robot = Robot()
    server = await asyncio.start_server(robot.listen, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    options = {"host": "127.0.0.1", "port": port}
    make = messages.MakeTransport(
        "wire", "urc.transports.tcp:from_setup", options, [], "", 0.22, False
    )
    lines = [GuardedLineSpec(make, TcpTransport("127.0.0.1", port))]
    held = {"drive": HeldSpec("wire", HoldTerms(b"", period_s=0.02))}
    guard = GuardClient(lines, held, partial(PipeChannel, is_inherited=False))
    guard.start()
    try:
        yield guard, robot
    finally:
        await guard.finish()
        server.close()


def process_of(guard: GuardClient) -> "subprocess.Popen[bytes]":
    assert isinstance(guard.channel, PipeChannel)
    assert guard.channel._process is not None
    return guard.channel._process


async def test_it_moves_and_stops_as_any_other() -> None:
    async with guarded() as (guard, robot):
        await guard.transports["wire"].open(BOUND_S)
        guard.arm("drive", HoldTerms(STOP, period_s=0.02))
        guard.tick("drive", b"go\n")
        await robot.hears(STOP)
        assert robot.heard == b"go\n" + STOP


async def test_the_next_one_stops_what_moved() -> None:
    async with guarded() as (guard, robot):
        await guard.transports["wire"].open(BOUND_S)
        guard.arm("drive", HoldTerms(STOP, period_s=0.02, lease_s=1.0))
        guard.tick("drive", b"go\n")
        await robot.hears(b"go\n")
        process_of(guard).kill()
        await robot.hears(b"go\n" + STOP)


async def test_a_guard_that_was_not_needed_is_ended_before_it_came() -> None:
    async with guarded() as (guard, robot):
        process = process_of(guard)
    assert process.poll() is not None
    assert robot.heard == b""


@pytest.mark.parametrize("word", [b"", b"guess", b"0" * 64])
async def test_a_stranger_is_turned_away(word: bytes) -> None:
    """And the guard is let in after it."""
    door = GuardAcceptor()
    admitted = asyncio.ensure_future(door.admitted())
    with socket.create_connection(("127.0.0.1", door.port)) as unknown_visitor:
        unknown_visitor.sendall(word)
        unknown_visitor.shutdown(socket.SHUT_WR)
        loop = asyncio.get_running_loop()
        unknown_visitor.setblocking(False)
        async with asyncio.timeout(BOUND_S):
            assert await loop.sock_recv(unknown_visitor, 1) == b""
    with socket.create_connection(("127.0.0.1", door.port)) as guard:
        guard.sendall(door.token)
        line = await admitted
        assert line.getpeername() == guard.getsockname()
        line.close()
