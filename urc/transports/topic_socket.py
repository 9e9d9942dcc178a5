"""Connected sockets for libraries with their own protocol, and one-line error texts.

The libraries would look up names in threads that delay the end of the program. This module connects
like the TCP transport, with the same error texts.
"""

import socket

from urc.transports._faults import explain, place_of, reason
from urc.transports._lookup import AddressLookup
from urc.transports.connect_race import connected

__all__ = ["Address", "reason"]


class Address:
    """The host and port of a connection, with their usual notation."""

    def __init__(self, host: str, port: int) -> None:
        """Initialise without a lookup."""
        self.host = host
        self.port = port
        self.text = place_of(host, port)
        self._lookup = AddressLookup(host, port, socket.SOCK_STREAM)

    async def dial(self, timeout_s: float) -> socket.socket:
        """Return a connected non-blocking socket; each address gets an equal share of the time.

        Raises:
            OSError, UnicodeError: an error for `explain`.
        """
        return await self._lookup.first(connected, timeout_s)

    def explain(self, fault: Exception) -> str:
        """Return one line for people with the reason of a failed `dial`."""
        if isinstance(fault, OSError | UnicodeError):
            return explain(self.host, self.text, fault)
        return f"cannot connect to {self.text} ({reason(fault)})"
