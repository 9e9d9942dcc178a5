"""The public fakes: what tests lean on must hold itself."""

import asyncio

import pytest

from urc.model.driver import FramingSpec
from urc.protocol.framing.table import build_framing
from urc.testing.clock import FakeClock, settle
from urc.testing.framing import feed_three_ways
from urc.testing.transport import MemoryTransport
from urc.transports.base import ConnectFailed, PeerClosed


class Greedy:
    """Gives whatever it is fed, so it depends on how the network cuts."""

    def feed(self, data: bytes) -> list[bytes]:
        return [data]


def test_feed_three_ways_gives_the_frames_of_a_sound_decoder() -> None:
    """Whole, byte by byte, and with trailing bytes are the same."""
    framing = build_framing(FramingSpec("delimiter", {"tx": b"\n", "rx": b"\r\n"}))
    assert feed_three_ways(framing.decoder, b"one\r\ntwo\r\n") == [b"one", b"two"]


def test_feed_three_ways_finds_a_decoder_that_trusts_the_network() -> None:
    """The message shows both results."""
    with pytest.raises(AssertionError, match="decoded byte by byte"):
        feed_three_ways(Greedy, b"one")


@pytest.mark.anyio
async def test_clock_stops_at_everything_that_falls_due() -> None:
    """In the order of time, each with its own time, and only what was not called off."""
    clock, seen = FakeClock(0.0), []
    for time_s in (3.0, 1.0, 2.0):
        clock.call_at(time_s, lambda: seen.append(clock.now()))
    clock.call_at(1.5, lambda: seen.append(-1.0)).cancel()
    sleeper = asyncio.create_task(clock.sleep(2.5))
    await clock.advance(2.4)
    assert (seen, sleeper.done()) == ([1.0, 2.0], False)
    await clock.advance(0.6)
    assert (seen, sleeper.done(), clock.now()) == ([1.0, 2.0, 3.0], True, 3.0)


@pytest.mark.anyio
async def test_memory_transport_keeps_the_contract_of_a_transport() -> None:
    """Refused, opened, used, hung up by the robot, closed twice, opened again."""
    line = MemoryTransport([b"hello"], answer=lambda data: [data.upper()])
    line.refuse("not now")
    with pytest.raises(ConnectFailed, match="not now"):
        await line.open(1)
    await line.open(1)
    assert await line.receive() == b"hello"
    await line.send(b"abc")
    assert await line.receive() == b"ABC"
    line.hang_up("gone")
    for _ in range(2):
        with pytest.raises(PeerClosed, match="gone"):
            await line.receive()
    await line.close()
    await line.close()
    with pytest.raises(PeerClosed):
        await line.send(b"abc")
    await line.open(1)
    assert await line.receive() == b"hello"


@pytest.mark.anyio
async def test_closing_wakes_a_receiver() -> None:
    """Nobody waits for ever on a line that was closed here."""
    line = MemoryTransport()
    await line.open(1)
    receiver = asyncio.create_task(line.receive())
    await settle()
    await line.close()
    with pytest.raises(PeerClosed):
        await receiver
