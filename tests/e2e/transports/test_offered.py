"""What is handed over without waiting goes straight to the kernel, on every loop, and in order."""

import asyncio
import socket
from collections.abc import Callable, Coroutine
from typing import Any

import pytest

from urc import _event_loop
from urc.transports.base import TransportError
from urc.transports.tcp import TcpTransport

WAIT_S = 20.0
PIECE = 1000
MOST_PIECES = 100_000

Run = Callable[[Coroutine[Any, Any, None]], None]
on_both_loops = pytest.mark.parametrize("run", [asyncio.run, _event_loop.run], ids=["own", "fast"])


def robot() -> socket.socket:
    """Listen, with room for little that nobody reads."""
    made = socket.socket()
    made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    made.bind(("127.0.0.1", 0))
    made.listen(1)
    made.settimeout(WAIT_S)
    return made


async def connected(door: socket.socket) -> tuple[TcpTransport, socket.socket]:
    transport = TcpTransport("127.0.0.1", door.getsockname()[1])
    await transport.open(WAIT_S)
    expectation, _ = await asyncio.to_thread(door.accept)
    expectation.settimeout(WAIT_S)
    return transport, expectation


@on_both_loops
def test_what_is_offered_is_there_before_the_loop_turns(run: Run) -> None:
    async def offer() -> None:
        with robot() as door:
            transport, expectation = await connected(door)
            with expectation:
                assert transport.offer(b"at once\n")
                assert expectation.recv(100) == b"at once\n", "nothing was awaited in between"
            await transport.close()

    run(offer())


@on_both_loops
def test_what_the_kernel_does_not_take_follows_in_order(run: Run) -> None:
    """The piece that goes in half is taken; the next is not, until there is room again."""

    def hear(expectation: socket.socket, size: int) -> bytes:
        heard = bytearray()
        while len(heard) < size:
            heard += expectation.recv(65536)
        return bytes(heard)

    async def offer() -> None:
        with robot() as door:
            transport, expectation = await connected(door)
            with expectation:
                pieces: list[bytes] = []
                while transport.offer(piece := len(pieces).to_bytes(4, "big") * (PIECE // 4)):
                    pieces.append(piece)
                    assert len(pieces) < MOST_PIECES, "the kernel is never full"
                assert transport.is_clogged
                sent = b"".join(pieces)
                assert await asyncio.to_thread(hear, expectation, len(sent)) == sent
                async with asyncio.timeout(WAIT_S):
                    await transport.send(b"then")
                assert transport.offer(b" this")
                assert await asyncio.to_thread(hear, expectation, 9) == b"then this"
            await transport.close()
            assert not transport.offer(b"nobody hears it")

    run(offer())


@on_both_loops
def test_what_is_offered_to_a_robot_that_is_gone_raises_nothing(run: Run) -> None:
    """Whoever reads the line is told, as ever."""

    async def offer() -> None:
        with robot() as door:
            transport, expectation = await connected(door)
            expectation.close()
            transport.offer(b"x")
            with pytest.raises(TransportError):
                async with asyncio.timeout(WAIT_S):
                    await transport.receive()
            assert not transport.offer(b"x")
            await transport.close()

    run(offer())
