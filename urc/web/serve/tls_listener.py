"""The first bytes of a connection to a TLS port, which are a handshake or plain HTTP.

Layer 5. A client can open many connections without finishing a handshake. `Handshakes` limits the
number and duration of handshakes and their share of the event loop's time.
"""

import asyncio
import ssl
from collections import Counter
from collections.abc import Callable
from functools import partial
from typing import cast

from urc.web.serve.tls_connection import TlsConnection

__all__ = ["HANDSHAKES", "HANDSHAKE_S", "SHARE", "FirstBytes", "Handshakes"]

HANDSHAKES = 128
"""Maximum number of unfinished handshakes. Above the limit, URC closes one connection from the
address with the most handshakes: the oldest without a complete first message, or else the
oldest."""
HANDSHAKE_S = 5.0
"""Time limit from opening a connection to the end of its handshake, in seconds."""
SHARE = 0.25
"""Maximum share of the event loop's time for handshakes, from 0 to 1; further handshakes wait."""
_TLS_HANDSHAKE = 0x16
"""First byte of a TLS connection (RFC 8446, 5.1); no HTTP method begins with this byte."""


class Handshakes:
    """The unfinished handshakes of one server."""

    def __init__(
        self,
        context: Callable[[], ssl.SSLContext],
        *,
        most: int = HANDSHAKES,
        limit_s: float = HANDSHAKE_S,
    ) -> None:
        """Start with no connections.

        Args:
            context: function that returns the current certificate and options.
            most: maximum number of unfinished handshakes.
            limit_s: time limit for a handshake, in seconds.
        """
        self.context = context
        self._most = most
        self._limit_s = limit_s
        self._open: dict[FirstBytes, asyncio.TimerHandle] = {}
        self._waiting: dict[FirstBytes, None] = {}
        self._free_s = 0.0
        """Time on the event loop's clock at which the next handshake step may begin."""
        self._is_timed = False

    def __len__(self) -> int:
        """Return the number of unfinished handshakes."""
        return len(self._open)

    def add(self, one: "FirstBytes") -> None:
        """Set the time limit for a new connection; above the limit of connections, close one."""
        loop = asyncio.get_running_loop()
        self._open[one] = loop.call_later(self._limit_s, one.abort)
        if len(self._open) > self._most:
            count = Counter(each.address for each in self._open)
            most = max(count.values())
            crowd = [each for each in self._open if count[each.address] == most]
            # A client that has sent a whole message will finish soon. Other clients may never send
            # one.
            min(crowd, key=lambda each: each.has_replied).abort()

    def remove(self, one: "FirstBytes") -> None:
        """Remove a connection that was lost or whose handshake has ended."""
        self._waiting.pop(one, None)
        timer = self._open.pop(one, None)
        if timer is not None:
            timer.cancel()

    def close(self) -> None:
        """Close all connections without a finished handshake."""
        for one in list(self._open):
            one.abort()

    def take_turn(self, one: "FirstBytes") -> None:
        """Continue a handshake now, or later if handshakes have used up their share of time."""
        if one not in self._waiting:
            self._waiting[one] = None
        if not self._is_timed:
            self._next()

    def _next(self) -> None:
        """Continue one waiting handshake; its duration determines when another may continue."""
        self._is_timed = False
        loop = asyncio.get_running_loop()
        if loop.time() < self._free_s:
            self._later(loop)
            return
        if self._waiting:
            one = next(iter(self._waiting))
            del self._waiting[one]
            begin_s = loop.time()
            one.continue_handshake()
            end_s = loop.time()
            self._free_s = end_s + (end_s - begin_s) * (1 / SHARE - 1)
        if self._waiting:
            self._later(loop)

    def _later(self, loop: asyncio.AbstractEventLoop) -> None:
        self._is_timed = True
        loop.call_at(self._free_s, self._next)


class FirstBytes(asyncio.Protocol):
    """The protocol of a new connection until its first bytes reveal TLS or plain HTTP."""

    def __init__(self, handshakes: Handshakes, make: Callable[[], asyncio.Protocol]) -> None:
        """Create the protocol.

        Args:
            handshakes: the unfinished handshakes of the server.
            make: function that creates the HTTP protocol.
        """
        self._handshakes = handshakes
        self._make = make
        self._tcp: asyncio.Transport | None = None
        self._secure: TlsConnection | None = None
        self.address = ""
        """Network address of the client."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the transport, and wait for the client's first bytes."""
        self._tcp = cast("asyncio.Transport", transport)
        peer = transport.get_extra_info("peername") or ("",)
        self.address = str(peer[0])
        self._handshakes.add(self)

    def data_received(self, data: bytes) -> None:
        """Begin a handshake, or pass plain HTTP to its protocol."""
        if self._tcp is None:
            return
        next_one: asyncio.Protocol
        if data[0] == _TLS_HANDSHAKE:
            next_one = self._secure = TlsConnection(
                self._tcp,
                self._handshakes.context(),
                self._make,
                partial(self._handshakes.take_turn, self),
                partial(self._handshakes.remove, self),
            )
        else:
            self._handshakes.remove(self)
            next_one = self._make()
            next_one.connection_made(self._tcp)
        self._tcp.set_protocol(next_one)
        next_one.data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._handshakes.remove(self)

    @property
    def has_replied(self) -> bool:
        """Whether the client has sent a complete first message."""
        return self._secure is not None and self._secure.has_replied

    def continue_handshake(self) -> None:
        """Process the received handshake data."""
        if self._secure is not None:
            self._secure.continue_handshake()

    def abort(self) -> None:
        """Close the connection because its handshake exceeded a limit."""
        self._handshakes.remove(self)
        if self._tcp is not None:
            self._tcp.abort()
