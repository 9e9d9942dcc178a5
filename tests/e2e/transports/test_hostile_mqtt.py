"""Brokers that are none: they flood, lie and never end what they begin."""

import asyncio
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from tests.e2e.transports.hostile import WAIT_S, Talk, bounded, ended, liar, turn_deaf, until
from tests.e2e.transports.leaks import nothing_left
from urc.transports.base import ConnectFailed, TopicSubscription, Transport, TransportSetup
from urc.transports.mqtt import from_setup

pytestmark = pytest.mark.anyio

WELCOME = b"\x20\x02\x00\x00"


def packet(kind: int, body: bytes) -> bytes:
    """Return a packet of MQTT 3.1.1."""
    length, rest = bytearray(), len(body)
    while True:
        length.append(rest % 128 | (0x80 if rest > 127 else 0))
        rest //= 128
        if not rest:
            return bytes((kind,)) + bytes(length) + body


def published(topic: bytes, payload: bytes, qos: int = 0, number: int = 1) -> bytes:
    """Return a message to the client."""
    numbered = struct.pack(">H", number) if qos else b""
    return packet(0x30 | qos << 1, struct.pack(">H", len(topic)) + topic + numbered + payload)


def broker(then: Talk) -> Talk:
    """Let the client in and grant what it subscribes to, then go on with `then`."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        writer.write(WELCOME)
        wish = await reader.read(1000)
        writer.write(packet(0x90, wish[2:4] + b"\x00"))
        await then(reader, writer)

    return talk


@asynccontextmanager
async def line(port: int, within_s: float = 20.0) -> AsyncIterator[Transport]:
    """Open a line, and see to it that nothing of it is left."""
    async with nothing_left():
        options = {"host": "127.0.0.1", "port": port, "version": "3.1.1"}
        transport = from_setup(TransportSetup("wire", options, (TopicSubscription("cells/+", {}),)))
        try:
            await transport.open(within_s)
            yield transport
        finally:
            await transport.close()
            del transport


async def ended_untaken(transport: Transport) -> str:
    """Wait for the end of the line, without taking anything before; return why."""
    await until(lambda: transport._session.queue.ended)  # type: ignore[attr-defined]
    return await ended(transport)


async def pong(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Say that the broker is there whenever it is asked, until the client has gone."""
    while data := await reader.read(1000):
        if b"\xc0\x00" in data:
            writer.write(b"\xd0\x00")


async def flood(writer: asyncio.StreamWriter, piece: bytes) -> None:
    while True:
        writer.write(piece)
        await writer.drain()


async def test_half_delivered_messages_end_the_line() -> None:
    """Sixty thousand begun deliveries would all be kept."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        for number in range(1, 60_000):
            writer.write(published(b"cells/1", bytes(20_000), qos=2, number=number))
            await writer.drain()

    async with liar(broker(talk)) as port, line(port) as transport:
        with bounded(30_000_000):
            assert "does not complete its message deliveries" in await ended_untaken(transport)


async def test_acknowledgements_that_nobody_takes_end_the_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """They are not heaped up, whatever the time-out of the system."""
    monkeypatch.setattr("urc.transports._stream._UNANSWERED_MS", 600_000)

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        turn_deaf(writer)
        await flood(writer, published(b"c", b"", qos=1) * 10_000)

    async with liar(broker(talk), window=4096) as port, line(port) as transport:
        with bounded(30_000_000):
            assert "acknowledgements" in await ended_untaken(transport)


async def test_the_system_tells_why_it_ended_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """A deaf broker has not closed the connection: the system gave up waiting for it."""
    monkeypatch.setattr("urc.transports._stream._UNANSWERED_MS", 50)
    monkeypatch.setattr("urc.transports.mqtt_client.MAX_UNTAKEN", 10**9)

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        turn_deaf(writer)
        await flood(writer, published(b"c", b"", qos=1) * 100)

    async with liar(broker(talk), window=4096) as port, line(port) as transport:
        assert await ended_untaken(transport) == "the connection broke (connection timed out)"


async def test_long_names_of_topics_are_counted() -> None:
    """Four thousand messages without a body, of sixty thousand bytes each."""
    sent = asyncio.Event()

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        answering = asyncio.create_task(pong(reader, writer))
        for number in range(3000):
            writer.write(published(b"%05d" % number + b"x" * 60_000, b""))
            await writer.drain()
        sent.set()
        await answering

    async with liar(broker(talk)) as port, line(port) as transport:
        with bounded(60_000_000):
            async with asyncio.timeout(WAIT_S):
                await sent.wait()
                await asyncio.sleep(0.2)  # what is in the kernel is read, too
        assert transport._session.queue.dropped > 1000  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("frame", "told"),
    [
        (b"\x30\xff\xff\xff\x7f" + bytes(1000), "more than"),
        (b"\x30\xff\xff\xff\xff\xff\x7f", "closed"),
        (published(b"\xff\xfe", b"x"), "invalid packet"),
        (b"\x30\x02\x00\x7f", "closed"),
        (b"\xf0\x00", "closed"),
        (bytes(1000), "closed"),
    ],
)
async def test_packets_that_lie_end_the_line(frame: bytes, told: str) -> None:
    """In one line."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(frame)
        await reader.read()

    async with liar(broker(talk)) as port, line(port) as transport:
        with bounded(10_000_000):
            assert told in await ended_untaken(transport)


async def test_broker_that_grants_nothing_and_talks_is_given_up() -> None:
    """`open` has its bound, however much comes meanwhile."""

    async def talk(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.read(1000)
        await flood(writer, published(b"cells/1", b"x") * 100)

    async with liar(talk) as port:
        with bounded(30_000_000), pytest.raises(ConnectFailed):
            async with line(port, within_s=2.0):
                pass
