"""Small messages that follow one another are received together; nothing else waits."""

import asyncio
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest
from websockets.asyncio.server import ServerConnection, serve

from urc.transports import websocket
from urc.transports.base import PeerClosed, TransportSetup
from urc.transports.websocket import WebSocketTransport

pytestmark = pytest.mark.anyio

WAIT_S = 5.0
COUNT = 60


@asynccontextmanager
async def connected() -> AsyncIterator[tuple[WebSocketTransport, ServerConnection, list[int]]]:
    """Yield a connected transport, the server's side, and the sizes of all reads."""
    met: asyncio.Future[ServerConnection] = asyncio.get_running_loop().create_future()

    async def meet(line: ServerConnection) -> None:
        met.set_result(line)
        await line.wait_closed()

    async with serve(meet, "127.0.0.1", 0, compression=None) as server:
        port = next(iter(server.sockets)).getsockname()[1]
        transport = WebSocketTransport(TransportSetup("ws", {"url": f"ws://127.0.0.1:{port}/"}))
        await transport.open(WAIT_S)
        reads: list[int] = []
        line = transport._socket
        assert line is not None
        before: Callable[[bytes], None] = line.data_received

        def count(data: bytes) -> None:
            reads.append(len(data))
            before(data)

        line.data_received = count  # type: ignore[method-assign] # to count the reads
        try:
            yield transport, await asyncio.wait_for(met, WAIT_S), reads
        finally:
            await transport.close()


async def received(transport: WebSocketTransport) -> bytes:
    return await asyncio.wait_for(transport.receive(), WAIT_S)


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not gather")
async def test_messages_that_follow_one_another_are_read_together_and_in_order() -> None:
    async with connected() as (transport, robot, reads):
        transport.gather()
        sent = [f"{number:03}" for number in range(COUNT)]

        async def send() -> None:
            for text in sent:
                await robot.send(text)
                await asyncio.sleep(0.003)

        sending = asyncio.create_task(send())
        found = [(await received(transport)).decode() for _ in sent]
        await sending
        assert found == sent
        assert len(reads) < COUNT / 2


@pytest.mark.skipif(sys.platform != "linux", reason="other systems do not gather")
async def test_large_messages_sent_ones_and_the_end_do_not_wait(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(websocket, "GATHER_S", 60.0)
    async with connected() as (transport, robot, _):
        transport.gather()
        await robot.send("first")
        assert await received(transport) == b"first"
        await robot.send("later")
        with pytest.raises(TimeoutError):
            await asyncio.wait_for(transport.receive(), 0.3)
        await transport.send(b"a stop")
        assert await asyncio.wait_for(robot.recv(), WAIT_S) == "a stop"
        await robot.send(bytes(40_000))
        assert await received(transport) == b"later"
        assert len(await received(transport)) == 40_000
        robot.transport.abort()
        with pytest.raises(PeerClosed):
            await received(transport)


async def test_without_gathering_every_message_is_read_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(websocket, "GATHER_S", 60.0)
    async with connected() as (transport, robot, _):
        for text in ("first", "later"):
            await robot.send(text)
            assert await received(transport) == text.encode()
