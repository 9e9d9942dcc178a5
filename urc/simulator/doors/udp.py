"""The emulated robot behind a UDP port.

A client is an address that datagrams come from. Where the driver has a port of its own
(``listen``), the robot talks there from the beginning, to this machine until one of its UDP ports
hears from another.
"""

import asyncio
import socket
from collections.abc import Sequence
from contextlib import suppress

from urc.model.codec import Payload
from urc.problems import UrcError
from urc.simulator.doors.base import (
    Crowd,
    Guest,
    Listening,
    Place,
    converse,
    option_port,
    reason,
    shown_place,
)

__all__ = ["UdpDoor"]

FORGOTTEN_S = 300.0
"""A client that says nothing for this long is gone; the port that is talked to anyway never is."""
_WAITING = 256
"""Datagrams of one client that may wait for the robot; more are lost."""

_Address = tuple[str, int]


class UdpDoor(asyncio.DatagramProtocol):
    """One port, and whoever sent something to it."""

    def __init__(self, place: Place) -> None:
        """Prepare the door; `open` takes the port."""
        self._place = place
        self._crowd = Crowd(place)
        self._line: asyncio.DatagramTransport | None = None
        self._inboxes: dict[_Address, asyncio.Queue[bytes]] = {}
        self._told: _Address | None = None
        """Where the driver listens."""

    async def open(self) -> Listening:
        """Take the port of the options, or any."""
        place = self._place
        port = option_port(place) if place.options.get("port") is not None else 0
        options: dict[str, str | int] = {"host": place.host}
        try:
            self._line, _ = await asyncio.get_running_loop().create_datagram_endpoint(
                lambda: self, local_addr=(place.host, port)
            )
        except OSError as fault:
            where = shown_place(place.host, port)
            message = f"transports.{place.name}: cannot listen on udp {where} ({reason(fault)})"
            raise UrcError(message) from fault
        host, port = self._line.get_extra_info("sockname")[:2]
        if place.options.get("port") is not None:
            options["port"] = port
        text = f"udp {shown_place(host, port)}"
        if place.options.get("listen") is not None:
            own = _free_port(place.host) if place.is_anywhere else option_port(place, "listen")
            options["listen"] = own
            self._told = (_reachable(place.host), own)
            text += f", talks to {shown_place(*self._told)}"
            self._meet(self._told)
        return Listening(host, port, text, options)

    async def close(self) -> None:
        """Free the port."""
        if self._line is not None:
            self._line.abort()
        await self._crowd.close()
        await asyncio.sleep(0)  # the loop closes the socket in its next turn

    def datagram_received(self, data: bytes, addr: tuple[str | int, ...]) -> None:
        """Take what a client says, and who it is."""
        address = str(addr[0]), int(addr[1])
        if not data:
            return
        if self._place.caller is not None:
            self._place.caller.host = address[0]
        if address not in self._inboxes:
            self._meet(address)
        with suppress(asyncio.QueueFull):
            self._inboxes[address].put_nowait(data)

    def _meet(self, address: _Address) -> None:
        inbox: asyncio.Queue[bytes] = asyncio.Queue(_WAITING)
        self._inboxes[address] = inbox

        def forget() -> None:
            if self._inboxes.get(address) is inbox:
                del self._inboxes[address]

        self._crowd.welcome(lambda guest: self._talk(guest, address, inbox), forget)

    async def _talk(self, guest: Guest, address: _Address, inbox: "asyncio.Queue[bytes]") -> None:
        loop = asyncio.get_running_loop()

        async def put(said: Sequence[Payload]) -> None:
            if address != self._told and loop.time() - guest.heard_s > FORGOTTEN_S:
                raise TimeoutError
            for datagram in said:
                if self._line is not None and isinstance(datagram, bytes):
                    self._line.sendto(datagram, self._now_at(address))

        await converse(self._place, guest, inbox.get, put)

    def _now_at(self, address: _Address) -> _Address:
        """Return where somebody is: whom the robot talks to unasked is who spoke to it last."""
        caller = self._place.caller
        if address != self._told or caller is None or not caller.host:
            return address
        return caller.host, address[1]


def _reachable(host: str) -> str:
    """Return this machine as it reaches itself."""
    if host in ("0.0.0.0", ""):  # noqa: S104 - compared, not bound
        return "127.0.0.1"
    return "::1" if host == "::" else host


def _free_port(host: str) -> int:
    """Return a port that nobody has, for the driver to take."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])
