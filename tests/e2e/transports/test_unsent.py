"""What the guard asks of a line beyond its five members: how much is unsent, and to forget it.

Both are optional. A line that has them tells the truth, and leaves nothing behind.
"""

import asyncio

import pytest

from tests.e2e.transports.peers.base import WAIT_S
from tests.e2e.transports.test_contract import (
    LATE_S,
    OPEN_S,
    class_of,
    hears,
    is_closed,
    large,
    robot,
    within,
)
from urc.model.payload import Envelope
from urc.transports.base import Transport, TransportError, TransportSetup
from urc.transports.http import from_setup

pytestmark = pytest.mark.anyio

COUNTED = (
    *("tcp", "tcp with tls", "websocket", "telnet", "ros", "mqtt", "zenoh", "ssh", "serial"),
    "http",
)
"""Lines that must tell: a robot that moves over one of them may be cut off."""

HELD_UP = tuple(kind for kind in COUNTED if class_of(kind).traits.pushes_back and kind != "http")
"""Those on which a robot can hold up the sender for good; http gives the oldest request up."""


def unsent_of(transport: Transport) -> int:
    count = getattr(transport, "unsent", None)
    assert count is not None, "it does not tell"
    return int(count())


async def settles(transport: Transport) -> None:
    """Wait until nothing is unsent."""
    async with asyncio.timeout(WAIT_S):
        while unsent_of(transport):  # noqa: ASYNC110 - nobody tells when bytes have left
            await asyncio.sleep(0.005)


@pytest.mark.parametrize("kind", COUNTED)
async def test_what_was_taken_is_not_unsent(kind: str) -> None:
    """A line that works is clear again after a moment."""
    async with robot(kind, "echo") as (peer, transport):
        assert unsent_of(transport) == 0
        await transport.open(OPEN_S)
        for _ in range(3):
            await within(WAIT_S, transport.send(peer.ask))
            await hears(transport, peer.answer)
            await settles(transport)
        await transport.close()
        assert unsent_of(transport) == 0


@pytest.mark.parametrize("kind", HELD_UP)
async def test_what_a_robot_does_not_take_is_unsent(kind: str) -> None:
    """It stays so for as long as the robot does not take it, and `abort` forgets it at once."""
    async with robot(kind, "deaf") as (peer, transport):
        await transport.open(OPEN_S)

        sent = 0

        async def fill() -> None:
            nonlocal sent
            while True:
                await transport.send(large(peer.ask))
                sent += 1
                await asyncio.sleep(0)

        filling = asyncio.ensure_future(fill())
        before, same = 0, 0
        async with asyncio.timeout(WAIT_S):
            while same < 5 and not filling.done():  # nothing goes in several turns of the loop
                same = same + 1 if sent == before and unsent_of(transport) else 0
                before = sent
                await asyncio.sleep(0.1)
        filling.cancel()
        await asyncio.gather(filling, return_exceptions=True)
        assert unsent_of(transport) > 0
        abort = getattr(transport, "abort", transport.close)
        await within(LATE_S, abort())
        assert unsent_of(transport) == 0


@pytest.mark.parametrize("kind", COUNTED)
async def test_aborted_line_is_closed_and_may_be_opened_again(kind: str) -> None:
    """As after `close`, and it may be called twice."""
    async with robot(kind, "echo") as (peer, transport):
        abort = getattr(transport, "abort", transport.close)
        await within(LATE_S, abort())
        await transport.open(OPEN_S)
        await within(LATE_S, abort())
        await within(LATE_S, abort())
        with pytest.raises(TransportError):
            await within(LATE_S, transport.send(peer.ask))
        await is_closed(transport, LATE_S)
        await transport.open(OPEN_S)
        await within(WAIT_S, transport.send(peer.ask))
        await hears(transport, peer.answer)


async def test_request_that_is_forgotten_never_arrives() -> None:
    """Each has a connection of its own, on which it would come after newer ones."""
    async with robot("http", "deaf") as (peer, transport):
        await transport.open(OPEN_S)
        body = bytes(16_000_000)  # more than this machine keeps for somebody who does not listen
        request = large(peer.ask)
        assert isinstance(request, Envelope)
        sending = asyncio.ensure_future(transport.send(request._replace(body=body)))
        async with asyncio.timeout(WAIT_S):
            while not unsent_of(transport):  # noqa: ASYNC110 - nobody tells
                await asyncio.sleep(0.01)
        forget = getattr(transport, "forget", None)
        assert forget is not None
        forget()
        assert unsent_of(transport) == 0
        await within(WAIT_S, sending)  # it was handed over; its answer says that there is none
        await transport.close()


async def test_connection_that_a_robot_has_closed_holds_nothing_up() -> None:
    """Small robots close idle ones after a while, and the next motion does not wait for that."""
    closed = asyncio.Event()

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            await reader.readuntil(b"\r\n\r\n")
            writer.write(b"HTTP/1.1 200 OK\r\nContent-Length: 2\r\n\r\nok")
            await writer.drain()
            await asyncio.sleep(0.05)
        except asyncio.IncompleteReadError:
            return
        finally:
            writer.close()
            closed.set()

    async with await asyncio.start_server(answer, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        transport = from_setup(TransportSetup("web", {"url": f"http://127.0.0.1:{port}/"}))
        await transport.open(OPEN_S)
        await transport.send(Envelope("request", {"path": "/go"}, None))
        await within(WAIT_S, transport.receive())
        await within(WAIT_S, closed.wait())
        await asyncio.sleep(0.1)
        assert unsent_of(transport) == 0
        await transport.close()
