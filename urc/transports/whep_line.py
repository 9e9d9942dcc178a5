"""The datagrams of WHEP: an ICE connection that talks only to the camera's own addresses.

Only the process of a camera imports this module. The library `aioice` would use all addresses of
this computer, and would answer checks from any address. Three of its methods are replaced: see
docs/decisions/0076.
"""

import asyncio
from collections.abc import Sequence
from typing import Final

from aioice import Candidate, Connection
from aioice.ice import StunProtocol
from aioice.stun import Message

from urc.transports.whep_sdp import WhepAnswer
from urc.video_reader import VideoFault

__all__ = ["CameraLine", "DatagramLine"]

CONNECT_S: Final = 8.0
"""Maximum time for the checks of ICE, in seconds."""
_MOST_BYTES: Final = 4096
_MOST_WAITING: Final = 2000
"""Largest datagram, and maximum number of datagrams that wait for the DTLS handshake."""


class CameraLine(Connection):
    """An ICE connection to one camera, without STUN and TURN servers."""

    def __init__(self, hosts: Sequence[str], own_hosts: Sequence[str]) -> None:
        """Create a line without sockets.

        Args:
            hosts: IP addresses of the camera; datagrams of all others are ignored.
            own_hosts: IP addresses of this computer for the sockets.
        """
        super().__init__(ice_controlling=True)
        self._hosts = frozenset(hosts)
        self._own_hosts = list(own_hosts)

    async def get_component_candidates(
        self, component: int, addresses: list[str], timeout: int = 5
    ) -> list[Candidate]:
        """Open the sockets, at the addresses that reach the camera."""
        return await super().get_component_candidates(component, self._own_hosts, timeout)

    def request_received(
        self, message: Message, addr: tuple[str, int], protocol: StunProtocol
    ) -> None:
        """Answer a check of the camera, and ignore all others."""
        if addr[0] in self._hosts:
            super().request_received(message, addr, protocol)

    def data_received(self, data: bytes, component: int) -> None:
        """Queue a datagram; drop it if it is empty, too long, or one too many."""
        if 0 < len(data) <= _MOST_BYTES and self._queue.qsize() < _MOST_WAITING:
            super().data_received(data, component)

    async def reach(self, answer: WhepAnswer) -> None:
        """Connect to a candidate of the answer.

        Raises:
            VideoFault: no candidate answers.
        """
        self.remote_username, self.remote_password = answer.user, answer.password
        self.remote_is_lite = answer.is_lite
        for host in answer.hosts:
            candidate = Candidate(
                host.foundation, 1, "udp", host.priority, host.address, host.port, "host"
            )
            await self.add_remote_candidate(candidate)
        await self.add_remote_candidate(None)
        try:
            async with asyncio.timeout(CONNECT_S):
                await self.connect()
        except (ConnectionError, TimeoutError) as fault:
            places = ", ".join(f"{one.address} port {one.port}" for one in answer.hosts[:3])
            raise VideoFault(
                f"no answer over UDP from {places}: a firewall may block UDP, or the server has"
                " ended the session"
            ) from fault


class DatagramLine:
    """A line with the methods that the library's DTLS transport calls."""

    role: Final = "controlling"

    def __init__(self, line: CameraLine) -> None:
        """Use `line` for all datagrams."""
        self._line = line

    async def _recv(self) -> bytes:
        return await self._line.recv()

    async def _send(self, data: bytes) -> None:
        await self._line.send(data)
