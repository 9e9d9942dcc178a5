"""Streams to a host and port: direct or tunnelled, with or without TLS."""

import asyncio
import socket
from functools import partial

from urc.transports._faults import explain, late, place_of
from urc.transports._lookup import AddressLookup
from urc.transports._stream import READ_AHEAD_BYTES, TcpStream, adopt
from urc.transports._tls import Tls
from urc.transports.base import ByteStream, ConnectFailed, Tunnel
from urc.transports.connect_race import connected

__all__ = ["StreamDialer"]


class StreamDialer:
    """Opens connections to one host and port, one with each call of `open`."""

    def __init__(
        self,
        host: str,
        port: int,
        *,
        tunnel: Tunnel | None = None,
        tls: Tls | None = None,
        read_ahead_bytes: int = READ_AHEAD_BYTES,
    ) -> None:
        """Prepare connections to `host` (name or address) and `port` (1 to 65535)."""
        self.host = host
        self.port = port
        self.place = place_of(host, port)
        """Host and port as text for messages."""
        self._tunnel = tunnel
        self._tls = tls
        self._read_ahead_bytes = read_ahead_bytes
        self._lookup = AddressLookup(host, port, socket.SOCK_STREAM)

    async def open(self, timeout_s: float) -> ByteStream:
        """Return an open stream within `timeout_s` seconds, or raise `ConnectFailed`.

        The addresses of a host name are tried in sequence, each with an equal share of the
        remaining time.
        """
        try:
            async with asyncio.timeout(timeout_s):
                stream = await self._connect(timeout_s)
                if self._tls is None:
                    return stream
                return await self._tls.secure(stream, self.host, self.place)
        except TimeoutError as fault:
            raise ConnectFailed(late(self.place, timeout_s)) from fault
        except (OSError, UnicodeError) as fault:
            raise ConnectFailed(explain(self.host, self.place, fault)) from fault

    async def _connect(self, timeout_s: float) -> ByteStream:
        if self._tunnel is not None:
            return await self._tunnel.connect(self.host, self.port, timeout_s)
        dial = partial(_dial, read_ahead_bytes=self._read_ahead_bytes)
        return await self._lookup.first(dial, timeout_s)


async def _dial(family: int, address: object, read_ahead_bytes: int) -> TcpStream:
    """Connect one socket; close the socket on failure or cancellation."""
    line = await connected(family, address)
    try:
        return await adopt(line, read_ahead_bytes)
    except BaseException:
        line.close()
        raise
