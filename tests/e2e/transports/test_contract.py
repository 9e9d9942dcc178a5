"""What every transport keeps, whatever it is: the same dialogues, the same shape of error.

A transport joins by a row in `PEERS`. What its kind cannot know it says in its peer's traits.
"""

import asyncio
import tracemalloc
from collections.abc import AsyncIterator, Awaitable
from contextlib import asynccontextmanager
from importlib import import_module

import pytest

from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.peers.base import WAIT_S, Behaviour, Peer, Traits
from urc.model.payload import Payload
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportError

pytestmark = pytest.mark.anyio

PEERS = {
    "tcp": "tests.e2e.transports.peers.tcp:TcpPeer",
    "tcp with tls": "tests.e2e.transports.peers.tcp_variants:TlsPeer",
    "tcp listening": "tests.e2e.transports.peers.tcp_variants:CallingPeer",
    "tcp guarded": "tests.e2e.transports.peers.guarded:GuardedPeer",
    "tcp guarded here": "tests.e2e.transports.peers.guarded:InnerPeer",
    "udp": "tests.e2e.transports.peers.udp:UdpPeer",
    "serial": "tests.e2e.transports.peers.serial:SerialPeer",
    "serial behind a socket": "tests.e2e.transports.peers.tcp_variants:SocketSerialPeer",
    "ssh": "tests.e2e.transports.peers.ssh:SshPeer",
    "telnet through ssh": "tests.e2e.transports.peers.ssh:CarriedPeer",
    "telnet": "tests.e2e.transports.peers.telnet:TelnetPeer",
    "http": "tests.e2e.transports.peers.http:HttpPeer",
    "websocket": "tests.e2e.transports.peers.websocket:WebSocketPeer",
    "ros": "tests.e2e.transports.peers.rosbridge:RosbridgePeer",
    "mqtt": "tests.e2e.transports.peers.mqtt:MqttPeer",
    "zenoh": "tests.e2e.transports.peers.zenoh:ZenohPeer",
}
"""Kind of transport (a variant after a space) → class of its `Peer`."""

OPEN_S = 15.0
REFUSED_S = 2.0
"""Where a robot is waited for, it costs this time until it is known not to be there."""
LATE_S = 10.0
"""What a transport may take beyond its time, on a busy machine."""
VANISHED_WITHIN_S = 40.0
"""When a robot that is sent to and gone without a word must be known to be gone."""
MEMORY_LIMIT = 8 * 1024 * 1024
"""Bytes that a flood, or a robot that takes nothing, may make Python allocate, both sides."""
SENDS_AT_MOST = 20_000


def class_of(kind: str) -> type[Peer]:
    module, _, name = PEERS[kind].partition(":")
    return getattr(import_module(module), name)  # type: ignore[no-any-return]


def kinds(**traits: object) -> pytest.MarkDecorator:
    """Run a test for every transport whose traits are as told."""

    def fits(kind: str) -> bool:
        of_kind: Traits = class_of(kind).traits
        return all(getattr(of_kind, name) == value for name, value in traits.items())

    return pytest.mark.parametrize("kind", [kind for kind in PEERS if fits(kind)])


@asynccontextmanager
async def robot(kind: str, behaviour: Behaviour) -> AsyncIterator[tuple[Peer, Transport]]:
    """Start a robot, give the closed line to it, and see to it that nothing is left of either."""
    peer = class_of(kind)()
    async with nothing_left():
        try:
            async with asyncio.timeout(3 * WAIT_S):
                transport = await peer.start(behaviour)
            try:
                yield peer, transport
            finally:
                await within(LATE_S, transport.close())
        finally:
            async with asyncio.timeout(WAIT_S):
                await peer.stop()
            del peer, transport


async def within(seconds: float, work: Awaitable[object]) -> None:
    async with asyncio.timeout(seconds):
        await work


async def hears(transport: Transport, expected: Payload) -> None:
    """Receive until `expected` has come, in however many pieces."""
    so_far = b""
    async with asyncio.timeout(WAIT_S):
        while True:
            got = await transport.receive()
            if not isinstance(expected, bytes):
                assert got == expected
                return
            assert isinstance(got, bytes)
            so_far += got
            assert expected.startswith(so_far)
            if so_far == expected:
                return


async def is_closed(transport: Transport, seconds: float = WAIT_S) -> str:
    """Receive until the line tells that it is closed; return why."""

    async def drain() -> None:
        while True:
            await transport.receive()

    with pytest.raises(PeerClosed) as told:
        await within(seconds, drain())
    return clear(told.value)


def clear(error: TransportError) -> str:
    """Return the text of an error, which people must be able to read."""
    text = str(error)
    assert text, "it says nothing"
    assert "\n" not in text
    assert len(text) <= 240, text
    for code in ("Errno", "Error(", "Exception", "Traceback", "<", "None", "object at"):
        assert code not in text, text
    return text


async def waits(work: asyncio.Task[Payload] | asyncio.Task[None]) -> None:
    """Assert that `work` is still waiting after everybody had a turn, then cancel it."""
    done, _ = await asyncio.wait([work], timeout=0.3)
    assert not done, f"it should wait: {work}"
    work.cancel()
    with pytest.raises(asyncio.CancelledError):
        await within(LATE_S, work)


@kinds()
async def test_line_carries_both_ways_and_may_be_opened_again(kind: str) -> None:
    """`close` may be called at any time, more than once, and is no end."""
    async with robot(kind, "echo") as (peer, transport):
        assert transport.address.split()[0] in kind.split()
        await transport.close()
        for _ in range(2):
            await transport.open(OPEN_S)
            for _ in range(3):
                await within(WAIT_S, transport.send(peer.ask))
                await hears(transport, peer.answer)
            await transport.close()
            await transport.close()


@kinds()
async def test_closed_line_takes_and_gives_nothing(kind: str) -> None:
    """Both members say so at once instead of waiting."""
    async with robot(kind, "echo") as (peer, transport):
        for _ in range(2):
            with pytest.raises(TransportError) as told:
                await within(LATE_S, transport.send(peer.ask))
            clear(told.value)
            await is_closed(transport, LATE_S)
            await transport.open(OPEN_S)
            await transport.close()


@kinds()
async def test_nothing_is_sent_again_after_reopening(kind: str) -> None:
    """What was for the old connection, taken or not, is not for the new one."""
    async with robot(kind, "echo") as (peer, transport):
        await transport.open(OPEN_S)
        await within(WAIT_S, transport.send(peer.ask))
        await transport.close()
        await transport.open(OPEN_S)
        await waits(asyncio.ensure_future(transport.receive()))  # type: ignore[arg-type]
        await within(WAIT_S, transport.send(peer.ask))
        await hears(transport, peer.answer)


@kinds(tells_close=True)
async def test_robot_that_closes_is_told(kind: str) -> None:
    """Receiving says why, each time it is asked; sending fails soon as well."""
    async with robot(kind, "closes") as (peer, transport):
        await transport.open(OPEN_S)
        await within(WAIT_S, transport.send(peer.ask))
        why = await is_closed(transport)
        assert await is_closed(transport, LATE_S) == why
        with pytest.raises(TransportError) as told:  # the first may still find a place
            await within(WAIT_S, sends_on(transport, peer.ask))
        clear(told.value)


@kinds(refusal="open")
async def test_robot_that_is_not_there_is_told_by_opening(kind: str) -> None:
    """At once, and again on the next attempt."""
    async with robot(kind, "refuses") as (_, transport):
        for _ in range(2):
            with pytest.raises(ConnectFailed) as told:
                await within(REFUSED_S + LATE_S, transport.open(REFUSED_S))
            clear(told.value)


@kinds(refusal="use")
async def test_robot_that_is_not_there_is_told_by_talking(kind: str) -> None:
    """Where opening asks nobody, the first thing sent does."""
    async with robot(kind, "refuses") as (peer, transport):
        await within(LATE_S, transport.open(OPEN_S))
        await within(WAIT_S, transport.send(peer.ask))
        await is_closed(transport)


@kinds(open_can_wait=True)
async def test_opening_ends_in_its_time(kind: str) -> None:
    """A robot that answers nothing at all costs the time that was given, and leaves nothing."""
    async with robot(kind, "mute") as (_, transport):
        began = asyncio.get_running_loop().time()
        with pytest.raises(ConnectFailed) as told:
            await within(0.5 + LATE_S, transport.open(0.5))
        assert asyncio.get_running_loop().time() - began >= 0.4
        assert "0.5 s" in clear(told.value)


@kinds(open_can_wait=True)
async def test_opening_may_be_cancelled(kind: str) -> None:
    """It leaves nothing, and the line may be closed or tried again."""
    async with robot(kind, "mute") as (_, transport):
        for _ in range(2):
            await waits(asyncio.ensure_future(transport.open(30.0)))  # type: ignore[arg-type]


@kinds()
async def test_receiving_may_be_cancelled(kind: str) -> None:
    """A robot that says nothing is waited for; giving up loses neither the line nor a byte."""
    async with robot(kind, "echo") as (peer, transport):
        await transport.open(OPEN_S)
        await waits(asyncio.ensure_future(transport.receive()))  # type: ignore[arg-type]
        await within(WAIT_S, transport.send(peer.ask))
        await hears(transport, peer.answer)


@kinds()
async def test_silent_robot_is_waited_for(kind: str) -> None:
    """It takes what is sent; what to make of its silence is for others to say."""
    async with robot(kind, "silent") as (peer, transport):
        await transport.open(OPEN_S)
        await within(WAIT_S, transport.send(peer.ask))
        await waits(asyncio.ensure_future(transport.receive()))  # type: ignore[arg-type]


@kinds()
async def test_robot_that_drips_is_heard_whole(kind: str) -> None:
    """In the smallest pieces, all of it arrives in order."""
    async with robot(kind, "drips") as (peer, transport):
        await transport.open(OPEN_S)
        for _ in range(2):
            await within(WAIT_S, transport.send(peer.ask))
            if isinstance(peer.ask, bytes) and not class_of(kind).traits.is_stream:
                for byte in peer.answer:
                    await hears(transport, bytes([byte]))  # type: ignore[list-item]
            else:
                await hears(transport, peer.answer)


@kinds()
async def test_flood_costs_bounded_memory(kind: str) -> None:
    """A robot that floods while nobody listens fills its own side; what comes then is whole."""
    async with robot(kind, "floods") as (peer, transport):
        await transport.open(OPEN_S)
        tracemalloc.start()
        try:
            await within(WAIT_S, transport.send(peer.ask))
            for _ in range(50):  # the loop turns all the while
                await asyncio.sleep(0.02)
            for _ in range(20):
                async with asyncio.timeout(WAIT_S):
                    got = await transport.receive()
                if isinstance(peer.answer, bytes):
                    assert set(got) <= set(peer.answer)
                else:
                    assert got == peer.answer
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert peak < MEMORY_LIMIT


async def sends_on(transport: Transport, payload: Payload) -> None:
    """Send for ever, or until the line has lost as much as nobody could hold."""
    for _ in range(SENDS_AT_MOST):
        await transport.send(payload)
        await asyncio.sleep(0)


def large(payload: Payload) -> Payload:
    return payload * 200 if isinstance(payload, bytes) else payload


@kinds(pushes_back=True, is_stream=True)
async def test_robot_that_takes_nothing_holds_up_the_sender(kind: str) -> None:
    """Sending waits, may be cancelled, and closing does not wait for what is unsent."""
    async with robot(kind, "deaf") as (peer, transport):
        await transport.open(OPEN_S)
        tracemalloc.start()
        try:
            sending = asyncio.ensure_future(sends_on(transport, large(peer.ask)))
            done, _ = await asyncio.wait([sending], timeout=1.0)
            assert not done, f"it took everything: {sending}"
            await waits(sending)  # type: ignore[arg-type]
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert peak < MEMORY_LIMIT
        await within(LATE_S, transport.close())


@kinds(pushes_back=False)
async def test_robot_that_takes_nothing_holds_up_nobody(kind: str) -> None:
    """What it does not take is lost, and nothing piles up for it."""
    async with robot(kind, "deaf") as (peer, transport):
        await transport.open(OPEN_S)
        tracemalloc.start()
        try:
            await within(6 * WAIT_S, sends_on(transport, peer.ask))
            _, peak = tracemalloc.get_traced_memory()
        finally:
            tracemalloc.stop()
        assert peak < MEMORY_LIMIT


@pytest.mark.needs("iptables")
@kinds(tells_vanishing=True)
async def test_robot_that_vanishes_without_a_word_is_told(kind: str) -> None:
    """No packet passes any more: what is sent is not acknowledged, and the line says so."""
    async with robot(kind, "echo") as (peer, transport):
        await transport.open(OPEN_S)
        await within(WAIT_S, transport.send(peer.ask))
        await hears(transport, peer.answer)
        await within(WAIT_S, peer.vanish())
        await within(WAIT_S, transport.send(peer.ask))
        await is_closed(transport, VANISHED_WITHIN_S)


@pytest.mark.needs("iptables")
@kinds(tells_vanishing=True, open_can_wait=True)
async def test_closing_does_not_wait_for_a_robot_that_vanished(kind: str) -> None:
    """At once, and opening then ends in its time."""
    async with robot(kind, "echo") as (peer, transport):
        await transport.open(OPEN_S)
        await within(WAIT_S, peer.vanish())
        await within(WAIT_S, transport.send(peer.ask))
        await within(LATE_S, transport.close())
        with pytest.raises(ConnectFailed) as told:
            await within(0.5 + LATE_S, transport.open(0.5))
        clear(told.value)
