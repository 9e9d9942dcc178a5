"""UDP: the transport against an asyncio datagram protocol, both to socat's echo."""

import asyncio
import platform
import socket
from collections import deque
from collections.abc import Sequence
from pathlib import Path

from bench.harness import Result
from bench.wire import Wire, measured, of_transport, running
from urc.transports.udp import UdpTransport

__all__ = ["run"]


class Inbox(asyncio.DatagramProtocol):
    """The least that one writes by hand: what came, and who waits for it."""

    def __init__(self) -> None:
        self.arrived: deque[bytes] = deque()
        self.waiter: asyncio.Future[None] | None = None

    def datagram_received(self, data: bytes, addr: tuple[str | int, ...]) -> None:
        self.arrived.append(data)
        if self.waiter is not None and not self.waiter.done():
            self.waiter.set_result(None)

    async def take(self) -> bytes:
        while not self.arrived:
            self.waiter = asyncio.get_running_loop().create_future()
            await self.waiter
        return self.arrived.popleft()


def run(*, full: bool = False) -> Sequence[Result]:
    """Measure the transport ``udp``."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]

    def is_ready() -> bool:
        return f":{port:04X} " in Path("/proc/net/udp").read_text("ascii")

    async def bare() -> Wire:
        loop = asyncio.get_running_loop()
        line, inbox = await loop.create_datagram_endpoint(Inbox, local_addr=("127.0.0.1", 0))

        async def send(data: bytes) -> None:
            line.sendto(data, ("127.0.0.1", port))

        async def close() -> None:
            line.close()
            await asyncio.sleep(0)

        return Wire(send, inbox.take, close)

    # A process of its own for each line, which ends by itself: datagrams have no end.
    where = f"UDP4-LISTEN:{port},bind=127.0.0.1,fork,reuseaddr"
    with running("socat", "-T2", where, "PIPE", is_ready=is_ready):
        return measured(
            "transport_udp",
            bare,
            lambda: of_transport(UdpTransport("127.0.0.1", port)),
            trips=2000,
            batches=40,
            batch=50,
            rounds=25 if full else 11,
            versions={"python": platform.python_version()},
        )
