"""WebSocket: the transport against the bare library `websockets`, both to websocketd's echo."""

import platform
import socket
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path

from websockets.asyncio.client import connect

from bench.harness import Result
from bench.wire import Wire, measured, of_transport, running
from urc.transports.base import Setup
from urc.transports.websocket import from_setup

__all__ = ["run"]


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure the transport ``websocket``."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    url = f"ws://127.0.0.1:{port}/"

    def is_ready() -> bool:
        return f":{port:04X} 00000000:0000 0A" in Path("/proc/net/tcp").read_text("ascii")

    async def bare() -> Wire:
        line = await connect(url, compression=None, proxy=None)

        async def receive() -> bytes:
            return await line.recv(decode=False)

        return Wire(line.send, receive, line.close)

    options = ("--binary", f"--port={port}", "--address=127.0.0.1", "--loglevel=error")
    with running("websocketd", *options, "cat", is_ready=is_ready):
        return measured(
            "transport_websocket",
            bare,
            lambda: of_transport(from_setup(Setup("socket", {"url": url, "send_as": "binary"}))),
            trips=1000,
            batches=20,
            batch=200,
            rounds=25 if full else 11,
            versions={"python": platform.python_version(), "websockets": version("websockets")},
        )
