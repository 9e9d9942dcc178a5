"""Telnet: the transport against asyncio's own streams, both to socat's echo.

The echo negotiates nothing, so what is compared is what Telnet costs each byte.
"""

import asyncio
import platform
import socket
from collections.abc import Sequence
from pathlib import Path

from bench.harness import Result
from bench.wire import Wire, measured, of_transport, running
from urc.transports.telnet import TelnetTransport, Wishes

__all__ = ["run"]


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure the transport ``telnet``."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    where = f"TCP-LISTEN:{port},bind=127.0.0.1,reuseaddr,fork,nodelay"

    def is_ready() -> bool:
        return f":{port:04X} 00000000:0000 0A" in Path("/proc/net/tcp").read_text("ascii")

    async def bare() -> Wire:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        async def send(data: bytes) -> None:
            writer.write(data)
            await writer.drain()

        async def close() -> None:
            writer.close()
            await writer.wait_closed()

        return Wire(send, lambda: reader.read(65536), close)

    with running("socat", where, "PIPE", is_ready=is_ready):
        return measured(
            "transport_telnet",
            bare,
            lambda: of_transport(TelnetTransport("127.0.0.1", port, Wishes())),
            trips=2000,
            batches=40,
            batch=400,
            rounds=25 if full else 11,
            versions={"python": platform.python_version()},
        )
