"""The socket below a browser client, and the limit on its messages.

Floor 5.
"""

import asyncio
from collections.abc import Callable
from typing import NamedTuple, Protocol

from starlette.types import Message

from urc.motion.lease import Role

__all__ = ["Allowance", "Flow", "Guest", "Line", "SocketFlow"]


class Line(Protocol):
    """The part of an accepted WebSocket that a client needs."""

    async def receive(self) -> Message:
        """Return the next ASGI message."""

    async def send_text(self, data: str) -> None:
        """Send one text message."""

    async def send_bytes(self, data: bytes) -> None:
        """Send one binary message."""

    async def close(self, code: int = 1000, reason: str | None = None) -> None:
        """Begin the closing handshake."""


class Flow(Protocol):
    """The state of the socket below a client."""

    def is_free(self) -> bool:
        """Whether the kernel has taken everything written so far."""

    async def drained(self) -> None:
        """Return when the kernel has taken everything written so far."""

    def write(self, frame: bytes) -> None:
        """Write whole WebSocket frames."""

    def listen(self, sink: Callable[[bytes], bool]) -> None:
        """Let `sink` have each text that came whole, before `Line.receive`.

        It saves the turns of a task. What it does not take, returning False, is for `receive`.
        """

    def hold_back(self, is_held: bool) -> None:
        """Let nothing more be read for now, or let it go on: what comes waits where it is."""

    def abort(self) -> None:
        """Cut the connection without waiting for anything."""


class SocketFlow:
    """Lets a client write whole frames, wait until the kernel has taken everything, or cut it."""

    def __init__(self) -> None:
        self.sink: Callable[[bytes], bool] | None = None
        """Called with each whole text message."""
        self._transport: asyncio.Transport | None = None
        self._is_free = True
        self._writable = asyncio.Event()
        self._writable.set()

    # Called by the protocol

    def made(self, transport: asyncio.Transport) -> None:
        """Take the transport, and have it report the first byte that the kernel does not take."""
        self._transport = transport
        transport.set_write_buffer_limits(high=0)

    def lost(self) -> None:
        """Let a waiting writer go on, to learn that the line is gone."""
        self.resume()

    def pause(self) -> None:
        """Take note that the kernel is full."""
        self._is_free = False
        self._writable.clear()

    def resume(self) -> None:
        """Take note that the kernel has taken everything."""
        self._is_free = True
        self._writable.set()

    # Called by the client

    def is_free(self) -> bool:
        """Return whether the kernel has taken everything written so far."""
        return self._is_free

    def is_closing(self) -> bool:
        """Return whether the transport takes nothing more."""
        return self._transport is None or self._transport.is_closing()

    async def drained(self) -> None:
        """Return when the kernel has taken everything written so far."""
        await self._writable.wait()

    def write(self, frame: bytes) -> None:
        """Write whole WebSocket frames."""
        if (transport := self._transport) and not transport.is_closing():
            transport.write(frame)

    def listen(self, sink: Callable[[bytes], bool]) -> None:
        """Let `sink` have each text that came whole."""
        self.sink = sink

    def hold_back(self, is_held: bool) -> None:
        """Let nothing more be read for now, or let it go on."""
        if self._transport and not self.is_closing():
            (self._transport.pause_reading if is_held else self._transport.resume_reading)()

    def abort(self) -> None:
        """Cut the connection without waiting for anything."""
        if self._transport:
            self._transport.abort()


class Allowance:
    """How many messages may come: a bucket that holds one second's worth."""

    def __init__(self, rate_hz: float, now_s: float) -> None:
        self._rate_hz = rate_hz
        self._left = rate_hz
        self._time_s = now_s

    def take(self, now_s: float) -> bool:
        """Count one message; False when it is one too many."""
        earned = (now_s - self._time_s) * self._rate_hz
        self._left = min(self._rate_hz, self._left + earned)
        self._time_s = now_s
        if self._left < 1:
            return False
        self._left -= 1
        return True


class Guest(NamedTuple):
    """The person or program at the other end."""

    place: str = ""
    """Address, for the others; "" for this machine."""
    role: Role = "driver"
    who: str = ""
    """Whose seats are counted together: one browser, program or address; "": nobody's."""
    is_known: bool = False
    """Whether it has a key; else `who` is an address."""
