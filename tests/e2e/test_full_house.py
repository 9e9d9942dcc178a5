"""Connections that do nothing, from the same address as STOP: it is answered all the same."""

import asyncio
import resource
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from websockets.asyncio.client import connect

from tests.e2e.dashboards import WAIT_S
from tests.e2e.keys import headers_for
from tests.e2e.processes import UrcProcess
from urc.web.fleet.robots import CLIENTS_OF_UNKNOWN

pytestmark = pytest.mark.anyio

IDLE = 1100
"""More than may be open at once."""
STOP = "/api/v1/robots/tello/stop"


@pytest.fixture(autouse=True)
def room_for_files() -> None:
    """Allow as many sockets as the test has; skip where the system does not."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = 2 * IDLE
    if soft < wanted and (hard < wanted and hard != resource.RLIM_INFINITY):
        pytest.skip(f"this system allows {hard} open files")
    if soft < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))


@pytest.fixture
async def address(urc_process: Callable[..., UrcProcess], tmp_path: Path) -> str:
    """The address of a dashboard that others reach, too."""
    words = (
        "--simulate",
        "--port",
        "0",
        "--host",
        "0.0.0.0",
        "--without-sign-in",
        "--data-dir",
        str(tmp_path),
    )
    process = urc_process("serve", "robots/tello.yaml", *words)
    found = (await process.wait_for_async(r"^dashboard (http://\S+)"))[1]
    return f"http://127.0.0.1:{urlsplit(found).port}/"


@asynccontextmanager
async def idle(address: str, said: bytes = b"") -> AsyncIterator[list[asyncio.StreamWriter]]:
    """Keep connections open that say nothing, or only begin to say something."""
    port = urlsplit(address).port
    writers: list[asyncio.StreamWriter] = []
    try:
        for _ in range(IDLE):
            _, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(said)
            writers.append(writer)
        yield writers
    finally:
        for writer in writers:
            writer.transport.abort()


async def asked(address: str, path: str, method: str = "GET") -> tuple[int, float]:
    """Ask on a connection of its own; return the status, and after how many ms it came."""
    parts = urlsplit(address)
    began = time.monotonic()
    async with asyncio.timeout(WAIT_S):
        reader, writer = await asyncio.open_connection(parts.hostname, parts.port)
        head = f"{method} {path} HTTP/1.1\r\nHost: {parts.netloc}\r\nOrigin: http://{parts.netloc}"
        writer.write(f"{head}\r\nContent-Length: 0\r\nConnection: close\r\n\r\n".encode())
        line = await reader.readline()
    took_ms = (time.monotonic() - began) * 1000
    writer.close()
    return int(line.split()[1]), took_ms


@pytest.mark.parametrize("said", [b"", b"POST /api/v1/robots/tello/stop HTTP/1.1\r\nHo"])
async def test_stop_is_answered_beside_connections_that_do_nothing(
    said: bytes, address: str
) -> None:
    """From the same address, without a key; and so is everything else."""
    url = address.replace("http", "ws") + "ws?robot=tello"
    origin = address.rstrip("/")
    async with connect(
        url,
        origin=origin,  # type: ignore[arg-type]
        additional_headers=headers_for(address),
    ):  # somebody looks at the robot: it is connected
        assert (await asked(address, STOP, "POST"))[0] == 200
        async with idle(address, said):
            assert (await asked(address, "/healthz"))[0] == 200  # all of them have come by now
            found = [await asked(address, STOP, "POST") for _ in range(10)]
            assert [status for status, _ in found] == [200] * 10


async def test_screens_of_one_stranger_leave_seats_to_others(address: str) -> None:
    """The next is told so; STOP, and the holder of the key who comes from there too, get in."""
    url = address.replace("http", "ws") + "ws?robot=tello"
    origin = address.rstrip("/")
    lines = [await connect(url, origin=origin) for _ in range(CLIENTS_OF_UNKNOWN + 3)]  # type: ignore[arg-type]
    try:
        said = [str(await line.recv()) for line in lines]
        assert ['"hello"' in text for text in said] == [True] * CLIENTS_OF_UNKNOWN + [False] * 3
        assert "too many of your screens are watching this robot" in said[-1]
        assert (await asked(address, STOP, "POST"))[0] == 200
        key = headers_for(address)
        async with connect(url, origin=origin, additional_headers=key) as line:  # type: ignore[arg-type]
            assert '"hello"' in str(await line.recv())
    finally:
        for line in lines:
            await line.close()
