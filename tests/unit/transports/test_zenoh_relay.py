"""The relay of a Zenoh connection reports every end, and waits for no router that takes nothing."""

import asyncio
import socket
from pathlib import Path

import pytest

from urc.transports.base import PeerClosed
from urc.transports.zenoh_relay import ZenohRelay

pytestmark = pytest.mark.anyio

WAIT_S = 5.0


class Wire:
    """A network connection that accepts data while `is_deaf` is false."""

    def __init__(self, *, is_deaf: bool = False) -> None:
        self.is_deaf = is_deaf
        self.fault = asyncio.get_running_loop().create_future()
        self.taken = b""
        self.is_closed = False

    async def read(self) -> bytes:
        await self.fault
        raise AssertionError

    async def write(self, data: bytes) -> None:
        if self.is_deaf:
            await asyncio.Event().wait()
        self.taken += data

    async def close(self) -> None:
        await self.abort()

    async def abort(self) -> None:
        self.is_closed = True


class Ends:
    def __init__(self) -> None:
        self.told: asyncio.Queue[tuple[str, bool]] = asyncio.Queue()

    def __call__(self, reason: str, by_library: bool) -> None:
        self.told.put_nowait((reason, by_library))

    async def next(self) -> tuple[str, bool]:
        return await asyncio.wait_for(self.told.get(), WAIT_S)


def library(endpoint: str) -> socket.socket:
    """Connect as the library does."""
    kind, _, place = endpoint.partition("/")
    if kind == "tcp":
        host, _, port = place.rpartition(":")
        return socket.create_connection((host, int(port)))
    made = socket.socket(socket.AF_UNIX)
    made.connect(f"/{place.lstrip('/')}")
    assert Path(place).name == "z"
    return made


@pytest.mark.parametrize(
    ("fault", "why"),
    [
        (PeerClosed("the robot closed the connection"), "the robot closed the connection"),
        (RuntimeError("odd"), "the relay failed (RuntimeError: odd)"),
    ],
)
async def test_end_is_told_whatever_ended_the_connection(fault: Exception, why: str) -> None:
    """Also for a mistake in a stream, because nobody would look after this connection."""
    wire, ends = Wire(), Ends()
    relay = ZenohRelay(wire, ends)
    with library(relay.listen()) as end:
        end.sendall(b"hello")
        while wire.taken != b"hello":  # noqa: ASYNC110
            await asyncio.sleep(0.01)
        waiting = asyncio.create_task(relay.passed(100, 60.0))
        await asyncio.sleep(0)
        wire.fault.set_exception(fault)
        assert await ends.next() == (why, False)
        await asyncio.wait_for(waiting, WAIT_S)
        assert wire.is_closed
        assert end.recv(1) == b""
    await relay.close()


async def test_wait_ends_when_nothing_is_accepted_but_not_while_something_is() -> None:
    wire = Wire()
    relay = ZenohRelay(wire, Ends())
    with library(relay.listen()) as end:
        slow = asyncio.create_task(relay.passed(10, 0.3))
        for _ in range(10):
            await asyncio.sleep(0.1)
            end.sendall(b"x")
        await asyncio.wait_for(slow, WAIT_S)
        wire.is_deaf = True
        end.sendall(b"lost")
        with pytest.raises(TimeoutError):
            await relay.passed(14, 0.3)
        assert relay.unsent() >= 4
    await relay.abort()
    await asyncio.wait_for(relay.passed(14, 60.0), WAIT_S)
