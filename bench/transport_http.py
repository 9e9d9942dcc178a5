"""HTTP: the transport against the bare library `httpx2`, both to lighttpd.

Two subjects: one request after the other, and four at a time, as many as the transport allows.
"""

import asyncio
import platform
import shutil
import socket
import tempfile
import time
from collections.abc import Awaitable, Callable, Sequence
from importlib.metadata import version
from pathlib import Path

import httpx2

from bench.harness import Goal, Result, compare
from bench.wire import ROUND_TRIP_AT_MOST, THROUGHPUT_AT_LEAST, running
from urc.model.codec import Envelope
from urc.transports.base import Setup
from urc.transports.http import IN_FLIGHT, from_setup

__all__ = ["run"]

ANSWER = b'{"battery": 87}'
REQUESTS = 400

CONFIG = """
server.document-root = "{root}"
server.port = {port}
server.bind = "127.0.0.1"
server.max-keep-alive-requests = 1000000
"""

Batch = Callable[[int], Awaitable[None]]
"""Makes so many requests at a time, and has all their answers."""


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure the transport ``http``."""
    program = shutil.which("lighttpd") or "/usr/sbin/lighttpd"
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]

    def is_ready() -> bool:
        return f":{port:04X} 00000000:0000 0A" in Path("/proc/net/tcp").read_text("ascii")

    rounds = 25 if full else 11
    versions = {"python": platform.python_version(), "httpx2": version("httpx2")}
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "state.json").write_bytes(ANSWER)
        config = Path(folder, "lighttpd.conf")
        config.write_text(CONFIG.format(root=folder, port=port))
        with running(program, "-D", "-f", str(config), is_ready=is_ready):
            url = f"http://127.0.0.1:{port}"
            return [
                compare(
                    Goal(f"transport_http: {what} / bare library", most),
                    lambda size=size: asyncio.run(_bare(url, size)),  # type: ignore[misc]
                    lambda size=size: asyncio.run(_ours(url, size)),  # type: ignore[misc]
                    rounds=rounds,
                    versions=versions,
                )
                for what, size, most in (
                    ("round trip", 1, ROUND_TRIP_AT_MOST),
                    ("time of many requests", IN_FLIGHT, 1 / THROUGHPUT_AT_LEAST),
                )
            ]


async def _bare(url: str, size: int) -> float:
    async with httpx2.AsyncClient(trust_env=False) as client:

        async def one() -> None:
            answer = await client.get(f"{url}/state.json")
            assert answer.content == ANSWER

        async def batch(count: int) -> None:
            await asyncio.gather(*(one() for _ in range(count)))

        return await _timed(batch, size)


async def _ours(url: str, size: int) -> float:
    transport = from_setup(Setup("web", {"url": url}))
    await transport.open(3.0)

    async def batch(count: int) -> None:
        for number in range(count):
            request = {"id": number, "method": "GET", "path": "/state.json"}
            await transport.send(Envelope("request", request))
        for _ in range(count):
            answer = await transport.receive()
            assert isinstance(answer, Envelope)
            assert answer.body == ANSWER

    spent_s = await _timed(batch, size)
    await transport.close()
    return spent_s


async def _timed(batch: Batch, size: int) -> float:
    await batch(size)
    began = time.perf_counter()
    for _ in range(REQUESTS // size):
        await batch(size)
    return time.perf_counter() - began
