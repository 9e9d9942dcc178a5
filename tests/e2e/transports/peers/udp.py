"""A robot on UDP, run by the test.

It cannot be known that it closes or vanishes: there is no connection. Opening asks nobody, so it
waits for nobody; and what it does not take is lost, as datagrams are.
"""

import asyncio
import socket

from tests.e2e.transports.peers.base import Behaviour, Traits
from urc.transports.base import Transport, TransportSetup
from urc.transports.udp import from_setup

__all__ = ["UdpPeer"]


class UdpPeer(asyncio.DatagramProtocol):
    """Listens on a free port of loopback."""

    traits = Traits(
        is_stream=False,
        open_can_wait=False,
        refusal="use",
        tells_close=False,
        tells_vanishing=False,
        pushes_back=False,
    )
    ask = b"battery?"
    answer = b"battery?"

    def __init__(self) -> None:
        self._behaviour: Behaviour = "echo"
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._line: asyncio.DatagramTransport | None = None
        self._task: asyncio.Task[None] | None = None

    async def start(self, behaviour: Behaviour) -> Transport:
        """Listen, unless the robot refuses."""
        self._behaviour = behaviour
        self._socket.bind(("127.0.0.1", 0))
        port = self._socket.getsockname()[1]
        if behaviour == "refuses":
            self._socket.close()
        elif behaviour != "deaf":
            loop = asyncio.get_running_loop()
            self._line, _ = await loop.create_datagram_endpoint(lambda: self, sock=self._socket)
        return from_setup(TransportSetup("wire", {"host": "127.0.0.1", "port": port}))

    def datagram_received(self, data: bytes, addr: tuple[str, int]) -> None:
        """Behave."""
        assert self._line is not None
        if self._behaviour == "echo":
            self._line.sendto(data, addr)
        elif self._behaviour == "drips":
            for byte in data:
                self._line.sendto(bytes([byte]), addr)
        elif self._behaviour == "floods" and self._task is None:
            self._task = asyncio.create_task(self._flood(addr))

    async def vanish(self) -> None:
        """Nobody can tell."""
        raise NotImplementedError

    async def stop(self) -> None:
        """Close the socket."""
        if self._task is not None:
            self._task.cancel()
            await asyncio.gather(self._task, return_exceptions=True)
        if self._line is not None:
            self._line.abort()
            await asyncio.sleep(0)
        self._socket.close()

    async def _flood(self, addr: tuple[str, int]) -> None:
        assert self._line is not None
        while True:
            for _ in range(100):
                self._line.sendto(self.answer, addr)
            await asyncio.sleep(0)
