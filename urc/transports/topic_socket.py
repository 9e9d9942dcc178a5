"""A connected socket for a library that brings its own protocol, and what went wrong in one line.

The libraries' own ways of connecting look names up in threads that a program waits for at its end;
this one does as the TCP transport does, and says the same when it fails.
"""

import socket

from urc.transports._faults import explain, place_of, reason
from urc.transports._lookup import Lookup
from urc.transports.hurry import connected

__all__ = ["Address", "reason"]


class Address:
    """Host and port of a line, and how people write them."""

    def __init__(self, host: str, port: int) -> None:
        """Prepare; nothing is looked up yet."""
        self.host = host
        self.port = port
        self.text = place_of(host, port)
        self._lookup = Lookup(host, port, socket.SOCK_STREAM)

    async def dial(self, timeout_s: float) -> socket.socket:
        """Return a connected socket that does not block; each address gets a fair share of time.

        Raises:
            OSError, UnicodeError: what `explain` puts into words.
        """
        return await self._lookup.first(connected, timeout_s)

    def explain(self, fault: Exception) -> str:
        """Return one line for people about why `dial` could not connect."""
        if isinstance(fault, OSError | UnicodeError):
            return explain(self.host, self.text, fault)
        return f"cannot connect to {self.text} ({reason(fault)})"
