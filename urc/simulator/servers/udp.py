"""An emulated robot behind a UDP port.

Clients are identified by the source address of their datagrams. If the driver listens on a port
(``listen``), the robot sends to that port from the start. Unsolicited datagrams are sent to the
local machine at first, then to the host that last sent data to the robot.
"""

import asyncio
import socket
from collections.abc import Sequence
from contextlib import suppress

from urc.model.payload import Payload
from urc.simulator.servers.base import (
    Endpoint,
    ServerContext,
    cannot_listen,
    host_and_port,
    option_port,
)
from urc.simulator.servers.clients import ClientConnection, Clients, converse

__all__ = ["UdpServer", "free_port", "reachable"]

FORGOTTEN_S = 300.0
"""Timeout for silent clients, in seconds; the timeout does not apply to the port on which the
driver listens."""
_WAITING = 256
"""Maximum number of queued datagrams per client; further datagrams are dropped."""

_Address = tuple[str, int]


class UdpServer(asyncio.DatagramProtocol):
    """One UDP port and its clients."""

    def __init__(self, context: ServerContext) -> None:
        self._context = context
        self._clients = Clients(context)
        self._line: asyncio.DatagramTransport | None = None
        self._receivers: dict[_Address, asyncio.Queue[bytes]] = {}
        self._told: _Address | None = None
        """Address on which the driver listens."""

    async def open(self) -> Endpoint:
        """Bind the configured port, or any free port."""
        context = self._context
        port = option_port(context) if context.options.get("port") is not None else 0
        options: dict[str, str | int] = {"host": context.host}
        try:
            self._line, _ = await asyncio.get_running_loop().create_datagram_endpoint(
                lambda: self, local_addr=(context.host, port)
            )
        except OSError as fault:
            raise cannot_listen(context, port, fault, "udp ") from fault
        host, port = self._line.get_extra_info("sockname")[:2]
        if context.options.get("port") is not None:
            options["port"] = port
        text = f"udp {host_and_port(host, port)}"
        if context.options.get("listen") is not None:
            own = free_port(context.host) if context.is_anywhere else option_port(context, "listen")
            options["listen"] = own
            self._told = (reachable(context.host), own)
            text += f", talks to {host_and_port(*self._told)}"
            self._meet(self._told)
        return Endpoint(host, port, text, options)

    async def close(self) -> None:
        """Free the port."""
        if self._line is not None:
            self._line.abort()
        await self._clients.close()
        await asyncio.sleep(0)  # the loop closes the socket in its next turn

    def datagram_received(self, data: bytes, addr: tuple[str | int, ...]) -> None:
        """Queue the client's datagram and record the client's address."""
        address = str(addr[0]), int(addr[1])
        if not data:
            return
        if self._context.last_peer is not None:
            self._context.last_peer.host = address[0]
        if address not in self._receivers:
            self._meet(address)
        with suppress(asyncio.QueueFull):
            self._receivers[address].put_nowait(data)

    def _meet(self, address: _Address) -> None:
        receiver: asyncio.Queue[bytes] = asyncio.Queue(_WAITING)
        self._receivers[address] = receiver

        def forget() -> None:
            if self._receivers.get(address) is receiver:
                del self._receivers[address]

        self._clients.admit(lambda client: self._talk(client, address, receiver), forget)

    async def _talk(
        self, client: ClientConnection, address: _Address, receiver: "asyncio.Queue[bytes]"
    ) -> None:
        loop = asyncio.get_running_loop()

        async def put(said: Sequence[Payload]) -> None:
            if address != self._told and loop.time() - client.active_s > FORGOTTEN_S:
                raise TimeoutError
            for datagram in said:
                if self._line is not None and isinstance(datagram, bytes):
                    self._line.sendto(datagram, self._now_at(address))

        await converse(self._context, client, receiver.get, put)

    def _now_at(self, address: _Address) -> _Address:
        """Return a client's address; for the driver's port, use the host of the last peer."""
        last_peer = self._context.last_peer
        if address != self._told or last_peer is None or not last_peer.host:
            return address
        return last_peer.host, address[1]


def reachable(host: str) -> str:
    """Return `host`, or the loopback address if `host` means all addresses."""
    if host in ("0.0.0.0", ""):  # noqa: S104 - compared, not bound
        return "127.0.0.1"
    return "::1" if host == "::" else host


def free_port(host: str) -> int:
    """Return a free UDP port on which the driver can listen."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])
