"""The listeners of this program's own dashboard: no line to a robot may lead there.

A document that connects to the dashboard would speak to it as any program of this machine does.
Each connection is looked at when it is made: names, redirections and forms of an address make no
difference then. What a router, a proxy or another machine leads back here is not known.
"""

import ipaddress
import socket
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from urc._addresses import Address, is_of_this_machine, unmapped

__all__ = ["OWN_DOORS", "OwnDoor", "OwnDoors"]


class OwnDoor(OSError):
    """A line leads to this program's own dashboard."""

    def __init__(self) -> None:
        super().__init__(None, "that is this dashboard itself: no robot may be reached there")


class OwnDoors:
    """Where this program listens."""

    def __init__(self) -> None:
        """Know none."""
        self._doors: list[tuple[Address, int]] = []

    @contextmanager
    def kept(self, listener: socket.socket) -> Iterator[None]:
        """Let no line lead to `listener` for as long as the context lasts."""
        place = listener.getsockname()
        door = (_address(place[0]), int(place[1]))
        self._doors.append(door)
        try:
            yield
        finally:
            self._doors.remove(door)

    def words(self) -> list[str]:
        """Return them as words for `learn`, in another process of this program."""
        return [f"{address}#{port}" for address, port in self._doors]

    def learn(self, words: Iterable[str]) -> None:
        """Know the listeners of another process of this program, for as long as this one runs."""
        for word in words:
            address, _, port = word.partition("#")
            self._doors.append((_address(address), int(port)))

    def check(self, line: socket.socket) -> None:
        """Raise `OwnDoor` when a connected socket leads to one of them."""
        peer = line.getpeername()
        if line.family in (socket.AF_INET, socket.AF_INET6):
            self.check_place(_address(peer[0]), peer[1])

    def check_place(self, address: Address, port: int, *, is_near: bool = True) -> None:
        """Raise `OwnDoor` when a connection to that place leads to one of them.

        Args:
            address: where to.
            port: where to.
            is_near: whether it is made on this machine; elsewhere a loopback address is another.
        """
        wanted = unmapped(address)
        if not is_near and (wanted.is_loopback or wanted.is_unspecified):
            return
        for door, its_port in self._doors:
            if port != its_port:
                continue
            if wanted == door or wanted.is_unspecified:
                raise OwnDoor
            if door.is_unspecified and is_of_this_machine(wanted):
                raise OwnDoor


def _address(text: str) -> Address:
    return unmapped(ipaddress.ip_address(text.partition("%")[0]))


OWN_DOORS = OwnDoors()
"""Of this process: a listener belongs to the program as a whole."""
