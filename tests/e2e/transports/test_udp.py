"""UDP beyond the contract: ports of one's own, who may answer, what can be told, real programs."""

import asyncio
import socket
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.programs import program
from urc.model.driver import Backoff, FramingSpec, Timeouts
from urc.model.profile import Profile
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.simulator.emulated_profile import stand_in
from urc.simulator.server import serve
from urc.testing.profile import line_profile
from urc.transports.base import ConnectFailed, PeerClosed, TransportError, TransportSetup
from urc.transports.udp import READ_AHEAD, UdpTransport, from_setup

pytestmark = pytest.mark.anyio

WAIT_S = 20.0


def line(**options: object) -> UdpTransport:
    made = from_setup(TransportSetup("wire", options))
    assert isinstance(made, UdpTransport)
    return made


@contextmanager
def robot(host: str = "127.0.0.1") -> Iterator[socket.socket]:
    """Give a socket that the test speaks through for the robot."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as talker:
        talker.bind((host, 0))
        talker.settimeout(WAIT_S)
        yield talker


@asynccontextmanager
async def opened(transport: UdpTransport) -> AsyncIterator[UdpTransport]:
    async with nothing_left():
        await transport.open(20.0)
        try:
            yield transport
        finally:
            await transport.close()


async def heard(transport: UdpTransport) -> bytes:
    return await asyncio.wait_for(transport.receive(), WAIT_S)


async def test_robot_sends_to_a_port_of_ours() -> None:
    """As drones push their state: nobody asked, and the port is agreed on."""
    port = free_port()
    with robot() as drone:
        async with opened(line(host="127.0.0.1", listen=port)) as transport:
            assert transport.address == f"udp *:{port} (listening for 127.0.0.1)"
            drone.sendto(b"h:40;", ("127.0.0.1", port))
            assert await heard(transport) == b"h:40;"
            await transport.send(b"thanks")  # no port was given: to where it came from
            assert drone.recv(100) == b"thanks"


async def test_only_the_robots_host_is_heard() -> None:
    """From any of its ports; a stranger's datagram is no frame of the robot."""
    port = free_port()
    with robot("127.0.0.2") as unknown_visitor, robot() as drone, robot() as other_port:
        async with opened(
            line(host="127.0.0.1", port=drone.getsockname()[1], listen=port)
        ) as transport:
            unknown_visitor.sendto(b"I am the robot", ("127.0.0.1", port))
            other_port.sendto(b"from another port", ("127.0.0.1", port))
            drone.sendto(b"", ("127.0.0.1", port))  # says nothing, and ends nothing
            drone.sendto(b"from the robot", ("127.0.0.1", port))
            assert await heard(transport) == b"from another port"
            assert await heard(transport) == b"from the robot"
            await transport.send(b"go")
            assert drone.recv(100) == b"go"
        options = {"host": "127.0.0.1", "listen": port, "from": "any"}
        async with opened(line(**options)) as transport:
            unknown_visitor.sendto(b"anybody", ("127.0.0.1", port))
            assert await heard(transport) == b"anybody"


async def test_whoever_talks_first_is_the_robot() -> None:
    """As vehicles call their ground station; the first datagram is not lost."""
    port = free_port()
    transport = line(listen=port)
    async with nothing_left():
        with pytest.raises(ConnectFailed) as told:
            await transport.open(0.2)
        expected = f"no datagram has reached udp *:{port} (listening) within 0.2 s"
        assert str(told.value) == expected
        with robot() as vehicle:
            opening = asyncio.ensure_future(transport.open(WAIT_S))
            while not opening.done():
                vehicle.sendto(b"heartbeat", ("127.0.0.1", port))
                await asyncio.sleep(0.05)
            await opening
            assert await heard(transport) == b"heartbeat"
            await transport.send(b"hello")
            assert vehicle.recv(100) == b"hello"
            await transport.close()


async def test_broadcast_is_answered_by_whoever_hears_it() -> None:
    """The address of loopback's network; without the option the system refuses."""
    with robot("0.0.0.0") as one:
        port = one.getsockname()[1]
        async with opened(line(host="127.255.255.255", port=port, broadcast=True)) as transport:
            await transport.send(b"who is there?")
            question, sender = one.recvfrom(100)
            assert question == b"who is there?"
            one.sendto(b"me", sender)
            assert await heard(transport) == b"me"
        async with opened(line(host="127.255.255.255", port=port)) as transport:
            with pytest.raises(TransportError):
                await transport.send(b"who is there?")


async def test_port_where_nobody_listens_is_told() -> None:
    """Once per opening, without holding up the loop, and good datagrams before it are kept."""
    port = free_port()
    async with opened(line(host="127.0.0.1", port=port)) as transport:
        for _ in range(3):
            await transport.send(b"anybody?")
            with pytest.raises(PeerClosed) as told:
                await heard(transport)
            assert str(told.value) == f"nothing listens on 127.0.0.1:{port} (port unreachable)"
            for _ in range(5):  # the loop turns all the while
                await asyncio.sleep(0.02)
            await transport.close()
            await transport.open(1.0)


async def sends_on(transport: UdpTransport) -> None:
    for _ in range(100):
        await transport.send(b"anybody?")
        await asyncio.sleep(0)


async def test_refusal_does_not_wake_the_loop_for_ever() -> None:
    """The system keeps why a datagram was refused, and says "readable" until that is read."""
    port = free_port()
    async with opened(line(host="127.0.0.1", port=port)) as transport:
        reads = 0
        original = transport._read

        def counted() -> None:
            nonlocal reads
            reads += 1
            original()

        loop = asyncio.get_running_loop()
        assert transport._line is not None
        loop.add_reader(transport._line, counted)
        with pytest.raises(PeerClosed):  # by the second or third: the first was refused
            await sends_on(transport)
        await asyncio.sleep(0.2)
        assert 0 < reads < 20


async def test_loop_that_cannot_watch_sockets_will_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on Windows: the same dialogue, and nothing is left."""

    def lacking(*_: object) -> None:
        raise NotImplementedError

    with robot() as drone:
        transport = line(host="127.0.0.1", port=drone.getsockname()[1])
        loop = asyncio.get_running_loop()
        async with nothing_left():
            with monkeypatch.context() as patched:
                patched.setattr(loop, "add_reader", lacking)
                await transport.open(20.0)
                await transport.send(b"go")
                data, sender = drone.recvfrom(100)
                drone.sendto(data + b"ne", sender)
                assert await heard(transport) == b"gone"
                await transport.close()


async def test_datagram_that_is_too_long_is_told() -> None:
    """It fails alone; the line goes on."""
    with robot() as drone:
        async with opened(line(host="127.0.0.1", port=drone.getsockname()[1])) as transport:
            with pytest.raises(TransportError) as told:
                await transport.send(bytes(65_508))
            assert str(told.value) == "65508 bytes are too many for one datagram"
            await transport.send(bytes(65_507))
            assert len(drone.recv(70_000)) == 65_507


async def test_newest_datagrams_win() -> None:
    """Nobody reads for a while: what is old goes, and is counted."""
    with robot() as drone:
        port = free_port()
        async with opened(line(host="127.0.0.1", listen=port)) as transport:
            for number in range(READ_AHEAD + 100):
                drone.sendto(str(number).encode(), ("127.0.0.1", port))
                await asyncio.sleep(0)
            async with asyncio.timeout(WAIT_S):
                while transport.dropped < 100:  # noqa: ASYNC110 - a counter wakes nobody
                    await asyncio.sleep(0.01)
            assert await heard(transport) == b"100"


async def test_unknown_host_and_taken_port_are_told() -> None:
    async with nothing_left():
        with pytest.raises(ConnectFailed) as told:
            await line(host="no-such-robot.invalid", port=1).open(WAIT_S)
        assert str(told.value) == "no such host 'no-such-robot.invalid'"
        with robot("0.0.0.0") as taken:
            port = taken.getsockname()[1]
            with pytest.raises(ConnectFailed) as told:
                await line(host="127.0.0.1", listen=port).open(WAIT_S)
        expected = f"cannot listen on udp 0.0.0.0:{port} (address already in use)"
        assert str(told.value) == expected


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({}, "udp needs the robot's host and port, or a local port in listen"),
        ({"host": "arm"}, "udp needs the robot's host and port, or a local port in listen"),
        ({"port": 1}, "udp needs a host name or address in host"),
        ({"listen": 1, "from": "host"}, "udp needs a host name or address in host"),
        ({"listen": 70_000}, "udp: listen must be an integer from 1 to 65535, not 70000"),
        ({"listen": 1, "from": "me"}, "udp: from must be any | host, not 'me'"),
    ],
)
async def test_bad_option_is_one_line(options: dict[str, object], told: str) -> None:
    with pytest.raises(TransportError) as problem:
        line(**options)
    assert str(problem.value) == told


@pytest.mark.needs("socat")
async def test_program_of_others_answers() -> None:
    """socat takes datagrams on a port and sends each back."""
    port = free_port()
    async with (
        program("socat", f"UDP4-RECVFROM:{port},bind=127.0.0.1,fork", "PIPE"),
        opened(line(host="127.0.0.1", port=port)) as transport,
    ):
        answer = b""
        for _ in range(100):  # until it listens
            try:
                await transport.send(b"battery?")
                answer = await asyncio.wait_for(transport.receive(), 0.5)
                break
            except (TransportError, TimeoutError):
                await transport.close()
                await asyncio.sleep(0.05)
                await transport.open(1.0)
        assert answer == b"battery?"


def datagram_profile() -> Profile:
    """The puppet with datagrams, and no line feeds."""
    profile = line_profile(
        every_s=0.1,
        transport="udp",
        timeouts=Timeouts(reply_s=5.0),
        backoff=Backoff(initial_s=0.05, max_s=0.2),
    )
    driver = profile.driver
    wire = driver.transports["wire"]._replace(framing=FramingSpec("datagram"))
    return profile._replace(driver=driver._replace(transports={"wire": wire}))


async def test_refused_robot_comes_back_to_the_same_session() -> None:
    """Off, on, off: the session stays, its line says what is wrong, and it goes on by itself."""
    profile = datagram_profile()
    port = free_port()
    settings = {"host": "127.0.0.1", "port": port}
    async with Session(profile, settings, built_in_catalog().transports) as session:

        async def until(state: str) -> None:
            with session.hub.subscribe() as subscription:
                async with asyncio.timeout(WAIT_S):
                    while session.hub.links["wire"].state != state:
                        subscription.changes()
                        await subscription.changed()

        for _ in range(2):
            await until("lost")
            expected = f"nothing listens on 127.0.0.1:{port} (port unreachable)"
            assert session.hub.links["wire"].detail == expected
            async with serve(profile, settings, now=lambda: 7.0):
                await until("live")
                assert (await session.command("ask")).values == {"battery": 7}


async def test_emulated_robot_stands_in_on_free_ports() -> None:
    """It tells where it is, and the profile leads there."""
    profile = datagram_profile()
    settings = {"host": "127.0.0.1", "port": 1}
    async with (
        stand_in(profile, settings) as redirected,
        Session(redirected, settings, built_in_catalog().transports) as session,
    ):
        values = (await session.command("ask")).values
        assert 0 <= values["battery"] < 100  # type: ignore[operator]
