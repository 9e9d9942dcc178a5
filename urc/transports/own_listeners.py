"""The listening addresses of URC's own dashboard, to which no transport may connect.

A document that connected to the dashboard would have the rights of a local program. The address of
each open connection is checked, so a host name, a redirect or an unusual notation cannot hide the
dashboard. Connections forwarded by a router, a proxy or another machine are not detected.
"""

import ipaddress
import socket
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from urc._addresses import Address, is_of_this_machine, unmapped

__all__ = ["OWN_DOORS", "OwnAddressError", "OwnListeners"]


class OwnAddressError(OSError):
    """Raised for an attempt to connect to URC's own dashboard."""

    def __init__(self) -> None:
        super().__init__(None, "this is the address of the dashboard itself, not of a robot")


class OwnListeners:
    """The addresses on which URC's own dashboard listens."""

    def __init__(self) -> None:
        """Initialise without listeners."""
        self._doors: list[tuple[Address, int]] = []

    @contextmanager
    def kept(self, listener: socket.socket) -> Iterator[None]:
        """Reject connections to `listener` while the context is open."""
        place = listener.getsockname()
        door = (_address(place[0]), int(place[1]))
        self._doors.append(door)
        try:
            yield
        finally:
            self._doors.remove(door)

    def words(self) -> list[str]:
        """Return the addresses as text, for `learn` in the guard process."""
        return [f"{address}#{port}" for address, port in self._doors]

    def learn(self, words: Iterable[str]) -> None:
        """Add the addresses in another process's `words`, until this process ends."""
        for word in words:
            address, _, port = word.partition("#")
            self._doors.append((_address(address), int(port)))

    def check(self, line: socket.socket) -> None:
        """Raise `OwnAddressError` if a socket is connected to URC's own dashboard."""
        peer = line.getpeername()
        if line.family in (socket.AF_INET, socket.AF_INET6):
            self.check_place(_address(peer[0]), peer[1])

    def check_place(self, address: Address, port: int, *, is_near: bool = True) -> None:
        """Raise `OwnAddressError` if a connection to `address` would reach URC's own dashboard.

        Args:
            address: target address.
            port: target port.
            is_near: whether the connection starts on this machine; if not, a loopback address
                belongs to another machine.
        """
        wanted = unmapped(address)
        if not is_near and (wanted.is_loopback or wanted.is_unspecified):
            return
        for door, its_port in self._doors:
            if port != its_port:
                continue
            if wanted == door or wanted.is_unspecified:
                raise OwnAddressError
            if door.is_unspecified and is_of_this_machine(wanted):
                raise OwnAddressError


def _address(text: str) -> Address:
    return unmapped(ipaddress.ip_address(text.partition("%")[0]))


OWN_DOORS = OwnListeners()
"""This process's listening addresses, shared by the whole program."""
