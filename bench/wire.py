"""What the benchmarks of the byte transports share: socat, round trips, streams of bytes.

Both sides do the same work against the same program: `Wire` is the bare library or the transport,
opened once a measurement; connecting is not timed.
"""

import asyncio
import os
import signal
import subprocess
import time
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

from bench.harness import Goal, Result, compare
from urc.transports.base import Transport

__all__ = ["MESSAGE", "Wire", "measured", "of_transport", "running"]

MESSAGE = b"Give me the battery %\n"
ROUND_TRIP_AT_MOST = 1.3
THROUGHPUT_AT_LEAST = 0.8
READY_S = 10.0


class Wire(NamedTuple):
    """One open line."""

    send: Callable[[bytes], Awaitable[None]]
    receive: Callable[[], Awaitable[bytes]]
    close: Callable[[], Awaitable[None]]


Open = Callable[[], Awaitable[Wire]]


@contextmanager
def running(*command: str, is_ready: Callable[[], bool]) -> Iterator[None]:
    """Run a program of others for the length of the context."""
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    until = time.monotonic() + READY_S
    try:
        while not is_ready():
            if process.poll() is not None or time.monotonic() > until:
                raise SystemExit(f"bench: {' '.join(command)} does not start")
            time.sleep(0.02)
        yield
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


async def of_transport(transport: Transport) -> Wire:
    """Open a transport as a wire."""
    await transport.open(READY_S)

    async def receive() -> bytes:
        got = await transport.receive()
        assert isinstance(got, bytes)
        return got

    return Wire(transport.send, receive, transport.close)


def measured(
    name: str,
    bare: Open,
    ours: Open,
    *,
    trips: int,
    batches: int,
    batch: int,
    rounds: int,
    versions: dict[str, str],
) -> Sequence[Result]:
    """Compare round trips, and how long it takes to bring bytes there and back.

    Args:
        name: of the transport.
        bare: opens the line by the bare library.
        ours: opens it by the transport.
        trips: round trips of one message a round.
        batches: how often `batch` messages are sent at once and all of it is read back, a round.
        batch: messages that are under way at once.
        rounds: of the comparison.
        versions: of what is compared.
    """
    there_and_back = compare(
        Goal(f"{name}: round trip / bare library", ROUND_TRIP_AT_MOST),
        lambda: asyncio.run(_round_trips(bare, trips)),
        lambda: asyncio.run(_round_trips(ours, trips)),
        rounds=rounds,
        versions=versions,
    )
    in_bulk = compare(
        Goal(f"{name}: time of a bulk transfer / bare library", 1 / THROUGHPUT_AT_LEAST),
        lambda: asyncio.run(_bulk(bare, batches, batch)),
        lambda: asyncio.run(_bulk(ours, batches, batch)),
        rounds=rounds,
        versions=versions,
    )
    return [there_and_back, in_bulk]


async def _round_trips(opening: Open, trips: int) -> float:
    wire = await opening()
    await _exchange(wire, MESSAGE)
    began = time.perf_counter()
    for _ in range(trips):
        await _exchange(wire, MESSAGE)
    spent_s = time.perf_counter() - began
    await wire.close()
    return spent_s


async def _bulk(opening: Open, batches: int, batch: int) -> float:
    wire = await opening()
    await _exchange(wire, MESSAGE)
    began = time.perf_counter()
    for _ in range(batches):
        for _ in range(batch):
            await wire.send(MESSAGE)
        await _heard(wire, batch * len(MESSAGE))
    spent_s = time.perf_counter() - began
    await wire.close()
    return spent_s


async def _exchange(wire: Wire, message: bytes) -> None:
    await wire.send(message)
    await _heard(wire, len(message))


async def _heard(wire: Wire, size: int) -> None:
    while size > 0:
        size -= len(await wire.receive())
    assert size == 0
