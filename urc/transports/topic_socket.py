"""Connected sockets and one-line error messages for third-party protocol libraries.

Without this module, the libraries would look up host names in threads that delay the program's
exit. This module connects in the same way as the TCP transport, with the same error messages.
"""

import socket

from urc.transports._faults import explain, place_of, reason
from urc.transports._lookup import AddressLookup
from urc.transports.connect_race import connected

__all__ = ["Address", "reason"]


class Address:
    """The host and port to which a protocol library needs a connection."""

    def __init__(self, host: str, port: int) -> None:
        """Store the host and the port, without an address lookup."""
        self.host = host
        self.port = port
        self.text = place_of(host, port)
        self._lookup = AddressLookup(host, port, socket.SOCK_STREAM)

    async def dial(self, timeout_s: float) -> socket.socket:
        """Return a connected non-blocking socket; each address gets an equal share of `timeout_s`.

        Raises:
            OSError, UnicodeError: the connection failed; `explain` returns a message.
        """
        return await self._lookup.first(connected, timeout_s)

    def explain(self, fault: Exception) -> str:
        """Return a one-line message with the reason for a failed `dial`."""
        if isinstance(fault, OSError | UnicodeError):
            return explain(self.host, self.text, fault)
        return f"cannot connect to {self.text} ({reason(fault)})"
