"""Servers that lie, flood and drip: the far end of a line as an attacker would make it."""

import asyncio
import gc
import socket
import tracemalloc
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress

import pytest

from urc.transports.base import PeerClosed, Transport

__all__ = ["WAIT_S", "Talk", "bounded", "ended", "liar", "turn_deaf", "until"]

WAIT_S = 45.0
COLLECTED = (700, 10, 10)
"""Python's own thresholds of the garbage collector; those of the tests are higher."""

Talk = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
"""What the server does with one connection; the connection is closed when it returns."""


@asynccontextmanager
async def liar(talk: Talk, *, window: int | None = None) -> AsyncIterator[int]:
    """Run a server that treats each client with `talk`; give its port.

    `window`: bytes that the system holds in either direction, about. By default it is megabytes,
    which cost a client a long time to fill, or to go over, in small packets.
    """
    tasks: set[asyncio.Task[None]] = set()

    async def meet(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        tasks.add(task)
        try:
            with suppress(OSError, EOFError, asyncio.CancelledError):
                await talk(reader, writer)
        finally:
            tasks.discard(task)
            writer.transport.abort()

    listener = socket.create_server(("127.0.0.1", 0))
    if window is not None:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, window)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, window)
    server = await asyncio.start_server(meet, sock=listener)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


async def ended(transport: Transport) -> str:
    """Take what comes until the line ends; return why, which is one short line."""

    async def drain() -> None:
        async with asyncio.timeout(WAIT_S):
            while True:
                await transport.receive()

    with pytest.raises(PeerClosed) as raised:
        await drain()
    text = str(raised.value)
    assert text.isprintable()
    assert len(text) < 400
    return text


async def until(is_so: Callable[[], object]) -> None:
    """Wait for what no event tells of."""
    async with asyncio.timeout(WAIT_S):
        while not is_so():  # noqa: ASYNC110
            await asyncio.sleep(0.01)


def turn_deaf(writer: asyncio.StreamWriter) -> None:
    """Take nothing of what the client sends from now on."""
    transport = writer.transport
    assert isinstance(transport, asyncio.Transport)
    transport.pause_reading()


@contextmanager
def bounded(most_bytes: int) -> Iterator[None]:
    """Fail when Python's own memory grows by more than `most_bytes` within the block."""
    thresholds = gc.get_threshold()
    gc.set_threshold(*COLLECTED)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        yield
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        gc.set_threshold(*thresholds)
    assert peak - before <= most_bytes, f"{(peak - before) / 1e6:.1f} MB more than before"
