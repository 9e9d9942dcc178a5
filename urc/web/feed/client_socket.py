"""The socket of a browser client and the rate limit for its messages.

Layer 5.
"""

import asyncio
from collections.abc import Callable
from typing import NamedTuple, Protocol

from starlette.types import Message

from urc.access.directory import NOBODY, Identity
from urc.model.role import Role

__all__ = [
    "ClientSocket",
    "FixedRights",
    "FlowControl",
    "PeerRights",
    "SocketFlow",
    "SocketPeer",
    "TokenBucket",
]


class ClientSocket(Protocol):
    """A client's accepted WebSocket, as the dashboard uses it."""

    async def receive(self) -> Message:
        """Return the next ASGI message."""

    async def send_text(self, data: str) -> None:
        """Send one text message."""

    async def close(self, code: int = 1000, reason: str | None = None) -> None:
        """Begin the WebSocket's closing handshake."""


class FlowControl(Protocol):
    """Flow control for a client's socket."""

    def is_free(self) -> bool:
        """Whether the kernel has accepted all written data."""

    async def drained(self) -> None:
        """Wait until the kernel has accepted all written data."""

    def write(self, frame: bytes) -> None:
        """Write complete WebSocket frames."""

    def listen(self, sink: Callable[[bytes], bool]) -> None:
        """Pass each complete text message directly to `sink`.

        The direct call saves two task switches per message. `receive` returns only messages for
        which `sink` returns False.
        """

    def notify(self, freed: Callable[[], None]) -> None:
        """Call `freed` whenever the kernel has accepted all written data after a pause."""

    def hold_back(self, is_held: bool) -> None:
        """Pause or resume reading; unread data stays in the kernel's buffer."""

    def abort(self) -> None:
        """Close the connection immediately, without a handshake."""


class SocketFlow:
    """The flow control of a socket: writing frames, waiting for an empty buffer and aborting."""

    def __init__(self) -> None:
        self.sink: Callable[[bytes], bool] | None = None
        """Callback for each complete text message."""
        self._freed: Callable[[], None] = _rest
        self._transport: asyncio.Transport | None = None
        self._is_free = True
        self._writable = asyncio.Event()
        self._writable.set()

    # Called by the protocol

    def connected(self, transport: asyncio.Transport) -> None:
        """Store the transport; request a callback when the kernel accepts no more bytes."""
        self._transport = transport
        transport.set_write_buffer_limits(high=0)

    def lost(self) -> None:
        """Wake a waiting writer, which then notices the closed connection."""
        self._freed = _rest
        self.resume()

    def pause(self) -> None:
        """Record that the kernel accepts no more data."""
        self._is_free = False
        self._writable.clear()

    def resume(self) -> None:
        """Record that the kernel has accepted all written data."""
        self._is_free = True
        self._writable.set()
        self._freed()

    # Called by the client

    def is_free(self) -> bool:
        """Return whether the kernel has accepted all written data."""
        return self._is_free

    def is_closing(self) -> bool:
        """Return whether the transport is closing."""
        return self._transport is None or self._transport.is_closing()

    async def drained(self) -> None:
        """Wait until the kernel has accepted all written data."""
        await self._writable.wait()

    def write(self, frame: bytes) -> None:
        """Write complete WebSocket frames."""
        if (transport := self._transport) and not transport.is_closing():
            transport.write(frame)

    def listen(self, sink: Callable[[bytes], bool]) -> None:
        """Pass each complete text message to `sink`."""
        self.sink = sink

    def notify(self, freed: Callable[[], None]) -> None:
        """Call `freed` whenever the kernel has accepted all written data after a pause."""
        self._freed = freed

    def hold_back(self, is_held: bool) -> None:
        """Pause or resume reading from the socket."""
        if self._transport and not self.is_closing():
            (self._transport.pause_reading if is_held else self._transport.resume_reading)()

    def abort(self) -> None:
        """Close the connection immediately, without a handshake."""
        if self._transport:
            self._transport.abort()

    def taken_over(self) -> asyncio.Transport | None:
        """Return the socket's transport for another protocol; None if the socket has ended."""
        return None if self.is_closing() else self._transport


def _rest() -> None:
    """Do nothing."""


class TokenBucket:
    """A token bucket for messages, with a capacity of one second's messages."""

    def __init__(self, rate_hz: float, now_s: float) -> None:
        self._rate_hz = rate_hz
        self._left = rate_hz
        self._time_s = now_s

    def allow(self, now_s: float) -> bool:
        """Count one message; return False if the message exceeds the rate limit."""
        earned = (now_s - self._time_s) * self._rate_hz
        self._left = min(self._rate_hz, self._left + earned)
        self._time_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True


class PeerRights(Protocol):
    """The current rights of a socket's peer for the socket's robot."""

    def role(self) -> Role | None:
        """Return the current role; None if the peer no longer has any right."""

    def may_give(self, command: str) -> bool:
        """Return whether the peer's token permits a command; "" stands for all commands."""

    def limit(self) -> str:
        """Return why the role is limited, as one line; "" if it is not."""


class FixedRights(NamedTuple):
    """Constant rights, for sockets without access control."""

    fixed: Role | None = "drive"

    def role(self) -> Role | None:
        """Return the role."""
        return self.fixed

    def may_give(self, command: str) -> bool:
        """Return True."""
        return True

    def limit(self) -> str:
        """Return "" for no limit."""
        return ""


class SocketPeer(NamedTuple):
    """The person or program at the remote end of a socket."""

    place: str = ""
    """Network address."""
    who: str = ""
    """Identifier or address used to count and limit one client's sockets; "" for no limit."""
    is_known: bool = False
    """Whether the visitor has signed in; if not, `who` is an address."""
    identity: Identity = NOBODY
    is_local: bool = False
    """Whether the visitor is the local user."""
    rights: PeerRights = FixedRights()
