"""Telnet against inetutils' own server, behind socat."""

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import suppress
from pathlib import Path

import pytest

from tests.e2e.transports.leaks import nothing_left
from tests.e2e.transports.telnetd import Telnetd
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportSetup
from urc.transports.telnet import from_setup

pytestmark = pytest.mark.anyio

WAIT_S = 20.0


@pytest.fixture
async def telnetd(tmp_path: Path) -> AsyncIterator[Telnetd]:
    """Run one server for one test."""
    server = Telnetd(tmp_path / "telnetd")
    await server.start()
    yield server
    server.kill()


def line_to(port: int, **options: object) -> Transport:
    return from_setup(TransportSetup("console", {"host": "127.0.0.1", "port": port, **options}))


async def hears(line: Transport, expected: bytes) -> bytes:
    """Return what came, up to and with `expected`."""
    got = b""
    async with asyncio.timeout(WAIT_S):
        while expected not in got:
            data = await line.receive()
            assert isinstance(data, bytes)
            got += data
    return got


@pytest.mark.needs("telnetd")
@pytest.mark.needs("socat")
@pytest.mark.parametrize("negotiate", ["passive", "full"])
async def test_robot_answers_without_an_echo(telnetd: Telnetd, negotiate: str) -> None:
    """After two rounds of negotiation, and every time that the line is opened."""
    line = line_to(telnetd.port, negotiate=negotiate)
    async with nothing_left():
        for _ in range(2):
            await line.open(WAIT_S)
            assert (await hears(line, b"> ")).endswith(b"robot ready\r\n> ")
            await line.send(b"battery\r")
            assert await hears(line, b"> ") == b"battery 42\r\n> "
            await line.close()
    assert telnetd.heard == ["battery", "battery"]


@pytest.mark.needs("telnetd")
@pytest.mark.needs("socat")
async def test_echo_comes_where_it_is_wanted(telnetd: Telnetd) -> None:
    """As a person would see it."""
    line = line_to(telnetd.port, echo=True)
    await line.open(WAIT_S)
    await hears(line, b"> ")
    await line.send(b"battery\r")
    assert await hears(line, b"> ") == b"battery\r\nbattery 42\r\n> "
    await line.close()


@pytest.mark.needs("telnetd")
@pytest.mark.needs("socat")
async def test_hundred_commands_in_one_go_arrive_once_each(telnetd: Telnetd) -> None:
    """In order, although they are sent before the first answer."""
    line = line_to(telnetd.port)
    await line.open(WAIT_S)
    await hears(line, b"> ")
    words = [f"say-{number}" for number in range(100)]
    for word in words:
        await line.send(word.encode() + b"\r")
    await hears(line, b"heard say-99\r\n> ")
    assert telnetd.heard == words
    await line.close()


@pytest.mark.needs("telnetd")
@pytest.mark.needs("socat")
async def test_killed_server_is_told_and_reached_again_when_it_is_back(telnetd: Telnetd) -> None:
    """The new line negotiates anew."""
    line = line_to(telnetd.port)
    async with nothing_left():
        await line.open(WAIT_S)
        await hears(line, b"> ")
        telnetd.kill()
        async with asyncio.timeout(WAIT_S):
            with suppress(PeerClosed):
                while True:
                    await line.receive()
        await line.close()
        with pytest.raises(ConnectFailed) as told:
            await line.open(WAIT_S)
        assert str(told.value) == (
            f"nothing listens on 127.0.0.1:{telnetd.port} (connection refused)"
        )
        await telnetd.start()
        await line.open(WAIT_S)
        await hears(line, b"> ")
        await line.close()


async def test_synch_of_a_server_does_no_harm() -> None:
    """Its urgent byte is one of the stream's: else it would swallow the next one of the text."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.setblocking(False)
        line = line_to(listener.getsockname()[1])
        await line.open(WAIT_S)
        robot, _ = await asyncio.get_running_loop().sock_accept(listener)
        with robot:
            robot.send(b"one\xff")
            robot.send(b"\xf2", socket.MSG_OOB)
            robot.send(b"two\n")
            assert await hears(line, b"\n") == b"onetwo\n"
            await line.close()
