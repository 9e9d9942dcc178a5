"""Connections for web transports: direct or tunnelled, with or without TLS.

`StreamDialer` returns streams, for the protocols that URC itself implements. A third-party protocol
library needs a socket instead. The library receives the socket of a plain connection, or one end of
a relayed socket pair.
"""

import asyncio
import socket
from collections.abc import Coroutine
from typing import Any

from urc.transports._faults import late
from urc.transports._stream import forget_unsent, unsent_in
from urc.transports._stream_dialer import StreamDialer
from urc.transports._tls import Tls
from urc.transports.base import (
    ByteStream,
    ConnectFailed,
    PeerClosed,
    SupportsReset,
    Tunnel,
    unsent_of,
)
from urc.transports.topic_socket import Address
from urc.transports.web_origin import WebOrigin

__all__ = ["Dialer"]

_PIECE_BYTES = 65536


class Dialer:
    """A reusable dialer for one web server."""

    def __init__(self, place: WebOrigin, *, tls: Tls | None, tunnel: Tunnel | None) -> None:
        """Store the origin `place`, the TLS settings, and the tunnel for future connections."""
        self._reach = StreamDialer(place.host, place.port, tunnel=tunnel, tls=tls)
        is_plain = tls is None and tunnel is None
        self._address = Address(place.host, place.port) if is_plain else None
        self._bridges: set[asyncio.Task[None]] = set()
        self._carried: ByteStream | None = None
        """Stream of the newest relayed connection; None without a relay."""

    @property
    def place(self) -> str:
        """The connection's target in readable form."""
        return self._reach.place

    async def stream(self, timeout_s: float) -> ByteStream:
        """Return an open stream within `timeout_s` seconds, or raise `ConnectFailed`."""
        return await self._reach.open(timeout_s)

    async def plug(self, timeout_s: float) -> socket.socket:
        """Return a connected socket within `timeout_s` seconds, or raise `ConnectFailed`."""
        if self._address is None:
            return self._bridge(await self._reach.open(timeout_s))
        try:
            async with asyncio.timeout(timeout_s):
                return await self._address.dial(timeout_s)
        except TimeoutError as fault:
            raise ConnectFailed(late(self.place, timeout_s)) from fault
        except (OSError, UnicodeError) as fault:
            raise ConnectFailed(self._address.explain(fault)) from fault

    def unsent(self, line: socket.socket) -> int:
        """Return the number of unacknowledged bytes of `line`, a socket from `plug`."""
        return unsent_in(line) + (unsent_of(self._carried) if self._bridges else 0)

    async def reset(self, line: socket.socket) -> None:
        """Reset the stream behind `line`, and make `line` discard unsent data when closed."""
        forget_unsent(line)
        carried = self._carried if self._bridges else None
        if carried is not None and isinstance(carried, SupportsReset):
            await carried.reset()

    async def close(self) -> None:
        """End all relays."""
        bridges = list(self._bridges)
        for bridge in bridges:
            bridge.cancel()
        await asyncio.gather(*bridges, return_exceptions=True)

    def _bridge(self, stream: ByteStream) -> socket.socket:
        self._carried = stream
        ours, theirs = socket.socketpair()
        ours.setblocking(False)
        theirs.setblocking(False)
        task = asyncio.create_task(_pump(stream, theirs))
        self._bridges.add(task)
        task.add_done_callback(self._bridges.discard)
        return ours


async def _pump(stream: ByteStream, end: socket.socket) -> None:
    """Copy bytes in both directions until either side ends, then end the other side."""
    loop = asyncio.get_running_loop()

    async def out() -> None:
        while data := await loop.sock_recv(end, _PIECE_BYTES):
            await stream.write(data)

    async def back() -> None:
        while True:
            await loop.sock_sendall(end, await stream.read())

    try:
        async with asyncio.TaskGroup() as ways:
            outward = ways.create_task(_until_closed(out()))
            inward = ways.create_task(_until_closed(back()))
            outward.add_done_callback(lambda _: inward.cancel())
            inward.add_done_callback(lambda _: outward.cancel())
    finally:
        end.close()
        await stream.abort()


async def _until_closed(way: Coroutine[Any, Any, None]) -> None:
    try:
        await way
    except (PeerClosed, OSError):
        return  # either side has ended; closing informs the other side
