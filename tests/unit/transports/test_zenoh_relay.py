"""The relay of a Zenoh connection reports every end, waits for no deaf router, and gathers data."""

import asyncio
import socket
from pathlib import Path

import pytest

from urc.transports import zenoh_relay
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


class Router:
    """A connection that delivers what `pieces` holds, all at once, as a socket does."""

    def __init__(self) -> None:
        self.pieces: asyncio.Queue[bytes] = asyncio.Queue()
        self.wrote: asyncio.Queue[bytes] = asyncio.Queue()

    async def read(self) -> bytes:
        data = await self.pieces.get()
        while not self.pieces.empty():
            data += self.pieces.get_nowait()
        return data

    async def write(self, data: bytes) -> None:
        self.wrote.put_nowait(data)

    async def close(self) -> None:
        await self.abort()

    async def abort(self) -> None:
        """Close at once."""


async def received(end: socket.socket, size: int, within_s: float = WAIT_S) -> bytes:
    loop = asyncio.get_running_loop()
    found = b""
    async with asyncio.timeout(within_s):
        while len(found) < size:
            found += await loop.sock_recv(end, 65536)
    return found


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zenoh_relay, "GATHER_S", 60.0)


@pytest.mark.usefixtures("slow")
async def test_small_pieces_are_gathered_and_large_ones_and_sent_data_do_not_wait() -> None:
    router = Router()
    relay = ZenohRelay(router, Ends())
    with library(relay.listen()) as end:
        end.setblocking(False)
        relay.is_gathering = True
        large = bytes(zenoh_relay.GATHER_BYTES)
        for piece in (large, b"small"):
            router.pieces.put_nowait(piece)
            assert await received(end, len(piece)) == piece
        router.pieces.put_nowait(b"later")
        with pytest.raises(TimeoutError):
            await received(end, 5, within_s=0.2)
        end.send(b"a stop")
        assert await asyncio.wait_for(router.wrote.get(), WAIT_S) == b"a stop"
        await asyncio.wait_for(relay.passed(6, 60.0), WAIT_S)
    await asyncio.wait_for(relay.close(), WAIT_S)


@pytest.mark.usefixtures("slow")
async def test_nothing_waits_while_the_session_opens() -> None:
    """After a reconnection, a stop waits for the session."""
    router = Router()
    relay = ZenohRelay(router, Ends())
    with library(relay.listen()) as end:
        end.setblocking(False)
        for piece in (b"one", b"two", b"six"):
            router.pieces.put_nowait(piece)
            assert await received(end, 3) == piece
    await relay.close()


async def test_gathered_pieces_arrive_whole_in_order_and_soon() -> None:
    router = Router()
    relay = ZenohRelay(router, Ends())
    with library(relay.listen()) as end:
        end.setblocking(False)
        relay.is_gathering = True
        sent = [bytes([number]) * 100 for number in range(40)]
        for piece in sent:
            router.pieces.put_nowait(piece)
            await asyncio.sleep(0.001)
        assert await received(end, 4000) == b"".join(sent)
    await relay.close()
