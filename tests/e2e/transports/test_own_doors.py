"""No line leads to the dashboard itself: each kind of transport, each form of the address."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import suppress

import asyncssh
import pytest

from tests.e2e.dashboards import running_dashboard
from tests.e2e.transports.peers.ssh import HOST_KEY
from urc.testing.dashboard import FakeRobot, dashboard_profile
from urc.transports.base import ConnectFailed, Transport, TransportSetup
from urc.transports.table import TRANSPORTS

pytestmark = pytest.mark.anyio

SAID = "this is the address of the dashboard itself, not of a robot"
WAIT_S = 5.0


@pytest.fixture
async def port() -> AsyncIterator[int]:
    """The port of a dashboard on this machine's loopback."""
    async with running_dashboard(FakeRobot(dashboard_profile())) as address:
        yield int(address.rstrip("/").rpartition(":")[2])


def lines(host: str, port: int) -> Mapping[str, Mapping[str, object]]:
    """Return each kind of transport that makes connections, with options that lead there."""
    shown = f"[{host}]" if ":" in host else host
    place = {"host": host, "port": port}
    login = {"username": "urc", "password": "x"}
    return {
        "tcp": place,
        "telnet": place,
        "http": {"url": f"http://{shown}:{port}/"},
        "websocket": {"url": f"ws://{shown}:{port}/ws?robot=puppet"},
        "ros": place,
        "mqtt": place,
        "zenoh": place,
        "camera": {"url": f"rtsp://{shown}:{port}/"},
        "ssh": {**place, **login},
    }


def made(kind: str, options: Mapping[str, object]) -> Transport:
    """Make a transport."""
    found: Transport = TRANSPORTS[kind].load()(TransportSetup("line", options))
    return found


@pytest.mark.parametrize("kind", sorted(lines("", 1)))
@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::ffff:127.0.0.1", "0.0.0.0"])
async def test_a_line_to_the_dashboard_is_refused(kind: str, host: str, port: int) -> None:
    """After it was connected, so that no name and no spelling makes a difference."""
    line = made(kind, lines(host, port)[kind])
    with pytest.raises(ConnectFailed) as told:
        await line.open(WAIT_S)
    assert SAID in str(told.value)
    assert "\n" not in str(told.value)
    await line.close()


async def test_what_the_dashboard_does_not_listen_on_is_another_program(port: int) -> None:
    """A robot's program may well run on the same machine."""
    server = await asyncio.start_server(lambda _, writer: writer.close(), "127.0.0.1", 0)
    async with server:
        line = made("tcp", lines("127.0.0.1", server.sockets[0].getsockname()[1])["tcp"])
        await line.open(WAIT_S)
        await line.close()
    gone = made("tcp", lines("127.0.0.2", port)["tcp"])
    with suppress(ConnectFailed):
        await gone.open(WAIT_S)
    await gone.close()


class _Forwards(asyncssh.SSHServer):
    """An SSH server of this machine that leads everywhere, as OpenSSH's does."""

    def begin_auth(self, username: str) -> bool:
        return False

    def connection_requested(
        self, dest_host: str, dest_port: int, orig_host: str, orig_port: int
    ) -> bool:
        return True


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::ffff:127.0.0.1", "0.0.0.0"])
async def test_nor_through_an_ssh_server_of_this_machine(host: str, port: int) -> None:
    """Names are looked up here, once: the server finds no other address for them."""
    acceptor = await asyncssh.listen(
        "127.0.0.1", 0, server_factory=_Forwards, server_host_keys=[HOST_KEY]
    )
    async with acceptor:
        jump = made(
            "ssh",
            {
                "host": "127.0.0.1",
                "port": acceptor.get_port(),
                "username": "urc",
                "host_key": HOST_KEY.get_fingerprint("sha256"),
                "mode": "forward",
            },
        )
        line = TRANSPORTS["tcp"].load()(
            TransportSetup("line", lines(host, port)["tcp"], tunnel=jump)
        )
        with pytest.raises(ConnectFailed) as told:
            await line.open(WAIT_S)
        assert SAID in str(told.value)
        await line.close()
        server = await asyncio.start_server(lambda _, writer: writer.close(), "127.0.0.1", 0)
        async with server:
            other = lines("localhost", server.sockets[0].getsockname()[1])["tcp"]
            line = TRANSPORTS["tcp"].load()(TransportSetup("line", other, tunnel=jump))
            await line.open(WAIT_S)
            await line.close()
        await jump.close()
