"""The end of a camera's connection, with a process that the test ends."""

import asyncio
from typing import Any

import pytest

from urc.testing.clock import settle
from urc.transports.base import TransportSetup
from urc.transports.camera_options import read_options
from urc.transports.camera_transport import CameraTransport, _CameraConnection

pytestmark = pytest.mark.anyio


class Pipe:
    def __init__(self) -> None:
        self.is_closed = False

    def close(self) -> None:
        self.is_closed = True


class Process:
    """A process that ends when the test lets it."""

    def __init__(self) -> None:
        self.stdin = Pipe()
        self.returncode: int | None = None
        self.kills = 0
        self.is_over = asyncio.Event()

    def kill(self) -> None:
        self.kills += 1

    async def wait(self) -> None:
        await self.is_over.wait()
        self.returncode = -9


class Relay:
    fault = ""

    def __init__(self) -> None:
        self.is_closed = False

    async def close(self) -> None:
        self.is_closed = True


def connected() -> tuple[CameraTransport, Process, Relay]:
    """Return an open transport whose process and relay are the test's own."""
    options = read_options(TransportSetup("eye", {"url": "rtsp://10.0.0.2/"}))
    transport, process, relay = CameraTransport(options), Process(), Relay()
    connection: Any = _CameraConnection("camera")
    connection._process, connection._relay = process, relay
    transport._connection = connection
    return transport, process, relay


async def cancelled(transport: CameraTransport) -> None:
    """Cancel the end of a transport while it waits for the process."""
    closing = asyncio.create_task(transport.close())
    await settle()
    assert not closing.done()
    closing.cancel()
    await asyncio.gather(closing, return_exceptions=True)


async def test_a_cancelled_end_goes_on_without_its_caller() -> None:
    """Otherwise the pipes of the process stay open."""
    transport, process, relay = connected()
    await cancelled(transport)
    assert process.kills
    process.is_over.set()
    await settle()
    assert process.stdin.is_closed
    assert relay.is_closed


async def test_the_next_end_waits_for_the_process_of_a_cancelled_one() -> None:
    """Otherwise a new connection could find the port of the old one in use."""
    transport, process, _ = connected()
    await cancelled(transport)
    second = asyncio.create_task(transport.close())
    await settle()
    assert not second.done()
    process.is_over.set()
    await second
    assert process.stdin.is_closed
    await transport.close()
