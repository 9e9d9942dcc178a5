"""The way in from other sites: TLS over lines of the fleet, then the ordinary HTTP server.

Layer 5. The other site proves its name by its certificate. Everything above is the same as for a
browser's connection: requests, sockets, flow control and limits.
"""

import asyncio
import ssl
from collections.abc import Callable, Mapping
from typing import Any, Final, cast

from urc.fleet.lines import LineTransport
from urc.problems import UrcError, printable
from urc.web.serve.site_peer import SitePeer
from urc.web.serve.tls_connection import TlsConnection
from urc.web.sites.refusal_log import RefusalLog

__all__ = ["HANDSHAKE_S", "SiteDoor"]

HANDSHAKE_S: Final = 5.0
"""Time limit for the TLS handshake, in seconds."""

_Make = Callable[[Mapping[str, Any]], asyncio.Protocol]


class SiteDoor:
    """Accepts the lines of other sites for one server."""

    def __init__(
        self,
        context: Callable[[], ssl.SSLContext],
        peer: Callable[[bytes], SitePeer],
        refusals: RefusalLog,
    ) -> None:
        """Create the door, which refuses all lines until `open`.

        Args:
            context: function that returns mutual TLS with the fleet's root certificate.
            peer: function that returns the site of a certificate in DER that TLS has proven. It
                raises `UrcError` for a revoked certificate.
            refusals: log of the refused lines.
        """
        self._refusals = refusals
        self._context = context
        self._peer = peer
        self._make: _Make | None = None

    def open(self, make: _Make) -> None:
        """Serve lines from now on.

        Args:
            make: function that creates the HTTP protocol; it receives additions to the state of
                each request. The key ``site`` contains the `SitePeer`.
        """
        self._make = make

    def close(self) -> None:
        """Refuse all further lines."""
        self._make = None

    def accept(self) -> asyncio.Protocol:
        """Return the protocol of a new line."""
        return _Entering(self)

    def secured(self, line: LineTransport) -> TlsConnection:
        """Return the TLS connection over a new line."""
        holder: list[TlsConnection] = []

        def made() -> asyncio.Protocol:
            return self._admitted(line, holder[0])

        def step() -> None:
            holder[0].continue_handshake()

        def ended() -> None:
            if fault := holder[0].fault:
                self._refusals.tell("a line", line.site, fault)

        connection = TlsConnection(line, self._context(), made, step, ended)
        holder.append(connection)
        return connection

    def _admitted(self, line: LineTransport, tls: TlsConnection) -> asyncio.Protocol:
        der = tls.get_extra_info("ssl_object").getpeercert(binary_form=True)
        try:
            peer = self._peer(der or b"")
        except UrcError as fault:
            return self._refused(line, str(fault))
        if peer.name != line.site:
            return self._refused(
                line, f"the certificate is for the site {peer.name}, not {printable(line.site)}"
            )
        if self._make is None:
            return self._refused(line, "the server is not ready; try again")
        return self._make({"site": peer})

    def _refused(self, line: LineTransport, reason: str) -> asyncio.Protocol:
        self._refusals.tell("a line", line.site, reason)
        line.refuse(reason)
        return _Refusing()


class _Entering(asyncio.Protocol):
    """A line whose TLS handshake has not begun."""

    def __init__(self, door: SiteDoor) -> None:
        self._door = door

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        line = cast("LineTransport", transport)
        tls = self._door.secured(line)
        line.set_protocol(tls)
        asyncio.get_running_loop().call_later(HANDSHAKE_S, _end_slow, tls)


class _Refusing(asyncio.Protocol):
    """A site that may not enter."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        cast("asyncio.Transport", transport).abort()


def _end_slow(tls: TlsConnection) -> None:
    if not tls.is_ready and not tls.is_closing():
        tls.abort()
