"""TCP beyond the contract: TLS, robots that connect to us, what is unsent, going through others."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from tests.e2e.ports import free_port
from tests.e2e.transports.authority import Authority, Pair
from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.packets import Loss
from tests.e2e.transports.programs import listens, program
from urc.runtime.registries import built_in_catalog
from urc.runtime.session import Session
from urc.simulator.emulated_profile import stand_in
from urc.testing.profile import line_profile
from urc.transports.base import (
    ByteStream,
    ConnectFailed,
    PeerClosed,
    TransportError,
    TransportSetup,
)
from urc.transports.tcp import TcpListener, TcpTransport, from_setup

pytestmark = [pytest.mark.anyio, pytest.mark.needs("socat")]

WAIT_S = 20.0


@pytest.fixture
def authority(tmp_path: Path) -> Authority:
    """One that this test's robots have their certificates from."""
    return Authority(tmp_path)


@asynccontextmanager
async def secret_echo(pair: Pair, more: str = "verify=0") -> AsyncIterator[int]:
    """Run socat as a robot that speaks TLS and says everything back; give its port."""
    port = free_port()
    where = f"OPENSSL-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork,cert={pair.cert},key={pair.key}"
    async with program("socat", "-b4096", f"{where},{more}", "PIPE"):
        await listens(port)
        yield port


def line(port: int, tls: object, host: str = "127.0.0.1") -> TcpTransport:
    made = from_setup(TransportSetup("wire", {"host": host, "port": port, "tls": tls}))
    assert isinstance(made, TcpTransport)
    return made


async def says_back(transport: TcpTransport | TcpListener, data: bytes) -> None:
    """Send and receive at once, as more than the buffers hold does not fit otherwise."""
    got = b""
    async with asyncio.timeout(WAIT_S):
        sending = asyncio.ensure_future(transport.send(data))
        while len(got) < len(data):
            got += await transport.receive()
        await sending
    assert got == data


async def hears_something(transport: TcpTransport | TcpListener) -> None:
    """Open and receive: with TLS 1.3 the other side refuses after the handshake."""
    await transport.open(20.0)
    await asyncio.wait_for(transport.receive(), WAIT_S)


async def refusal(transport: TcpTransport) -> str:
    with pytest.raises(ConnectFailed) as told:
        await transport.open(20.0)
    return str(told.value)


async def test_line_is_encrypted(authority: Authority) -> None:
    """A megabyte goes both ways, and the line may be opened again."""
    async with secret_echo(authority.sign("127.0.0.1")) as port, nothing_left():
        transport = line(port, {"ca": authority.file})
        for _ in range(2):
            await transport.open(20.0)
            await says_back(transport, b"Give me the battery %\n")
            await says_back(transport, bytes(range(256)) * 4096)
            await transport.close()


async def test_certificate_of_an_unknown_authority_is_refused(authority: Authority) -> None:
    """By the system's authorities, and by another one; unless checking is switched off."""
    async with secret_echo(authority.sign("127.0.0.1")) as port, nothing_left():
        told = f"the certificate of 127.0.0.1:{port} is from an unknown authority; see tls.ca"
        assert await refusal(line(port, tls=True)) == told
        other = Authority(Path(authority.file).parent)
        assert await refusal(line(port, {"ca": other.file})) == told
        transport = line(port, {"verify": False})
        await transport.open(20.0)
        await says_back(transport, b"hello")
        await transport.close()


async def test_expired_certificate_is_refused(authority: Authority) -> None:
    """The person reads that it is the date, and not the cable."""
    async with secret_echo(authority.sign("127.0.0.1", age_days=30)) as port:
        told = await refusal(line(port, {"ca": authority.file}))
        assert told == f"the certificate of 127.0.0.1:{port} has expired"


async def test_certificate_must_be_for_the_name(authority: Authority) -> None:
    """The host's, or the one in server_name."""
    async with secret_echo(authority.sign("arm-7.lab.example")) as port:
        told = await refusal(line(port, {"ca": authority.file}))
        place = f"127.0.0.1:{port}"
        assert told == f"the certificate of {place} is not for '127.0.0.1'; see tls.server_name"
        transport = line(port, {"ca": authority.file, "server_name": "arm-7.lab.example"})
        await transport.open(20.0)
        await says_back(transport, b"hello")
        await transport.close()


async def test_robot_without_tls_is_told() -> None:
    """It answers with something else, or hangs up, or says nothing."""
    port = free_port()
    listening = f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork"
    async with program("socat", listening, "SYSTEM:'echo 220 ready; sleep 5'"):
        await listens(port)
        assert await refusal(line(port, tls=True)) == f"127.0.0.1:{port} does not speak TLS"
    port = free_port()
    listening = f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork"
    async with program("socat", listening, "SYSTEM:'head -c 1 >/dev/null'"):
        await listens(port)
        told = await refusal(line(port, tls=True))
        assert told.startswith(f"no TLS connection to 127.0.0.1:{port} (")
    port = free_port()
    async with program("socat", f"TCP-LISTEN:{port},bind=127.0.0.1,fork", "SYSTEM:'sleep 60'"):
        await listens(port)
        with pytest.raises(ConnectFailed) as late:
            await line(port, tls=True).open(0.5)
        assert str(late.value) == f"no answer from 127.0.0.1:{port} within 0.5 s"


async def test_robot_may_ask_for_our_certificate(authority: Authority) -> None:
    """From files, or the key as the text of a secret setting."""
    own = authority.sign("station")
    more = f"verify=1,cafile={authority.file}"
    async with secret_echo(authority.sign("127.0.0.1"), more) as port:
        key = Path(own.key).read_text("ascii")
        transport = line(port, {"ca": authority.file, "cert": own.cert, "key": key})
        await transport.open(20.0)
        await says_back(transport, b"hello")
        await transport.close()
        bare = line(port, {"ca": authority.file})
        with pytest.raises(TransportError):
            await hears_something(bare)
        await bare.close()


@pytest.mark.parametrize(
    ("tls", "told"),
    [
        ({"ca": "/nowhere.pem"}, "tcp, tls: cannot use ca (no such file or directory)"),
        ({"key": "/nowhere.key"}, "tcp, tls: cert must contain a certificate"),
        ({"verify": "no"}, "tcp, tls: verify must be true or false, not 'no'"),
        ("yes", "tcp: tls must be true, false or a mapping of options, not 'yes'"),
    ],
)
async def test_bad_option_is_one_line(tls: object, told: str) -> None:
    with pytest.raises(TransportError) as problem:
        line(6789, tls)
    assert str(problem.value) == told


# ---- the robot connects to us


def listener(**options: object) -> TcpListener:
    made = from_setup(TransportSetup("wire", {"mode": "listen", "port": free_port(), **options}))
    assert isinstance(made, TcpListener)
    return made


async def test_robot_connects_to_us() -> None:
    """It may come before, while or after somebody waits for it; nobody else is let in."""
    async with nothing_left():
        transport = listener()
        assert transport.address == f"tcp 127.0.0.1:{transport.port} (listening)"
        with pytest.raises(ConnectFailed) as told:
            await transport.open(0.2)
        expected = f"no robot has connected to 127.0.0.1:{transport.port} within 0.2 s"
        assert str(told.value) == expected
        async with program("socat", "-b4096", f"TCP:127.0.0.1:{transport.port}", "PIPE"):
            await transport.open(20.0)
            await says_back(transport, b"hello")
            await transport.close()


async def test_newer_robot_takes_the_place_of_the_older() -> None:
    """The one that stands is told to be over; the next opening gets the newer one."""
    async with nothing_left():
        transport = listener()
        with pytest.raises(ConnectFailed):
            await transport.open(0.05)
        _, older = await asyncio.open_connection("127.0.0.1", transport.port)
        await transport.open(20.0)
        reader, newer = await asyncio.open_connection("127.0.0.1", transport.port)
        with pytest.raises(PeerClosed) as told:
            await asyncio.wait_for(transport.receive(), WAIT_S)
        assert str(told.value).startswith("another robot has replaced this connection (127.0.0.1:")
        await transport.close()
        await transport.open(20.0)
        newer.write(b"it is me")
        assert await asyncio.wait_for(transport.receive(), WAIT_S) == b"it is me"
        await transport.send(b"welcome")
        assert await asyncio.wait_for(reader.readexactly(7), WAIT_S) == b"welcome"
        await transport.close()
        for writer in (older, newer):
            writer.close()


async def test_only_the_robots_host_is_let_in() -> None:
    """Another machine's call is closed, and the robot's is waited for."""
    transport = listener(host="127.0.0.2")
    with pytest.raises(ConnectFailed):
        await transport.open(0.05)
    unknown_visitor = await asyncio.open_connection("127.0.0.1", transport.port)
    with pytest.raises(ConnectFailed):
        await transport.open(0.3)
    assert await asyncio.wait_for(unknown_visitor[0].read(1), WAIT_S) == b""
    robot = await asyncio.open_connection("127.0.0.1", transport.port, local_addr=("127.0.0.2", 0))
    await transport.open(20.0)
    await transport.close()
    for _, writer in (unknown_visitor, robot):
        writer.close()


async def test_emulated_robot_calls_the_driver_that_listens() -> None:
    """Out of one profile; and it calls again after it was cut off."""
    profile = line_profile(every_s=None)
    driver = profile.driver
    wire = driver.transports["wire"]._replace(options={"mode": "listen", "port": 7000})
    profile = profile._replace(driver=driver._replace(transports={"wire": wire}))
    settings = {"host": "127.0.0.1", "port": 7000}
    async with (
        stand_in(profile, settings) as emulated,
        Session(emulated, settings, built_in_catalog().transports) as session,
    ):
        for _ in range(2):
            assert 0 <= (await session.command("ask")).values["battery"] < 100  # type: ignore[operator]
    with pytest.raises(TransportError) as told:
        from_setup(TransportSetup("wire", {"host": "arm", "port": 1, "bind": "0.0.0.0"}))
    assert str(told.value) == "tcp accepts bind and from only with mode: listen"


async def test_port_that_is_taken_is_told() -> None:
    """The person reads which one."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        transport = TcpListener("127.0.0.1", port)
        with pytest.raises(ConnectFailed) as told:
            await transport.open(1.0)
        assert str(told.value) == f"cannot listen on 127.0.0.1:{port} (address already in use)"
        await transport.close()


async def test_robot_connects_to_us_with_tls(authority: Authority) -> None:
    """It checks our certificate, and we check its own."""
    own, robots = authority.sign("127.0.0.1"), authority.sign("robot")
    transport = listener(tls={"cert": own.cert, "key": own.key, "ca": authority.file})
    where = f"OPENSSL:127.0.0.1:{transport.port},cafile={authority.file},retry=20,interval=0.1"
    async with program("socat", "-b4096", f"{where},cert={robots.cert},key={robots.key}", "PIPE"):
        await transport.open(20.0)
        await says_back(transport, b"hello")
        await transport.close()
    unknown_visitor = f"OPENSSL:127.0.0.1:{transport.port},verify=0,retry=20,interval=0.1"
    async with program("socat", "-b4096", unknown_visitor, "PIPE"):
        with pytest.raises(TransportError):
            await hears_something(transport)
        await transport.close()


# ---- for the motion contract


async def sends_on(transport: TcpTransport) -> None:
    while True:
        await transport.send(b"stick" * 1000)


def reads_to_the_end(connection: socket.socket) -> None:
    while connection.recv(65536):
        pass


async def test_unsent_bytes_are_counted_and_can_be_forgotten() -> None:
    """A robot that reads nothing; after the reset nothing of it arrives late."""
    with socket.socket() as robot:
        robot.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        robot.bind(("127.0.0.1", 0))
        robot.listen()
        transport = TcpTransport("127.0.0.1", robot.getsockname()[1])
        await transport.open(20.0)
        assert transport.unsent() == 0
        connection, _ = robot.accept()
        with connection:
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(sends_on(transport), 0.5)
            assert transport.unsent() > 10_000
            await transport.abort()
            assert transport.unsent() == 0
            connection.settimeout(WAIT_S)
            with pytest.raises(ConnectionResetError):
                reads_to_the_end(connection)


@pytest.mark.needs("iptables")
async def test_quiet_line_that_is_cut_is_told() -> None:
    """Nobody sends anything; the system's own probes find out."""
    port = free_port()
    loss = Loss(port)
    async with program("socat", "-b4096", f"TCP-LISTEN:{port},bind=127.0.0.1", "PIPE"):
        await listens(port)
        transport = TcpTransport("127.0.0.1", port)
        await transport.open(20.0)
        try:
            await loss.begin()
            with pytest.raises(PeerClosed) as told:
                await asyncio.wait_for(transport.receive(), 2 * WAIT_S)
            assert str(told.value) == "the connection broke (connection timed out)"
        finally:
            await loss.end()
            await transport.close()


# ---- through another transport


class Relay:
    """Carries to what listens on this machine, whatever host is asked for."""

    def __init__(self, port: int) -> None:
        self._port = port
        self.asked: list[tuple[str, int]] = []

    async def connect(self, host: str, port: int, timeout_s: float) -> ByteStream:
        self.asked.append((host, port))
        inner = TcpTransport("127.0.0.1", self._port)
        await inner.open(timeout_s)
        assert inner._stream is not None
        return inner._stream


async def test_line_goes_through_another_transport(authority: Authority) -> None:
    """TLS included: it is for the robot's name, not for whom it goes through."""
    async with secret_echo(authority.sign("arm.inside")) as port, nothing_left():
        relay = Relay(port)
        options = {"host": "arm.inside", "port": 443, "tls": {"ca": authority.file}}
        transport = from_setup(TransportSetup("wire", options, tunnel=relay))
        assert isinstance(transport, TcpTransport)
        await transport.open(20.0)
        assert relay.asked == [("arm.inside", 443)]
        await says_back(transport, b"hello")
        await transport.close()
