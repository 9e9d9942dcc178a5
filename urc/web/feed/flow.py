"""The socket below a browser client: whether it is free, and the number by which it is written to.

Floor 5. A frame for many clients costs one system call for each, and the loop's own transport as
much again. So while nothing waits, frames may be written past it; whatever the kernel does not
take, or has to say, is the transport's business.
"""

import asyncio
import sys
from collections.abc import Callable
from typing import Final

from urc.web.feed.crowd import NO_NUMBER

__all__ = ["SocketFlow"]

_HAS_NUMBERS: Final = sys.platform != "win32"
"""Whether a socket is written to like a file."""


class SocketFlow:
    """Lets a client write whole frames, wait until the kernel has taken everything, or cut it."""

    def __init__(self) -> None:
        self.sink: Callable[[bytes], bool] | None = None
        """Takes each text that came whole."""
        self._transport: asyncio.Transport | None = None
        self._number = NO_NUMBER
        self._busy: Callable[[], None] = _nobody
        self._is_free = True
        self._writable = asyncio.Event()
        self._writable.set()

    # What the protocol says

    def made(self, transport: asyncio.Transport) -> None:
        """Take the transport, and let it say so as soon as the kernel is full."""
        self._transport = transport
        transport.set_write_buffer_limits(high=0)
        line = transport.get_extra_info("socket")
        is_plain = transport.get_extra_info("sslcontext") is None
        if _HAS_NUMBERS and is_plain and line is not None:
            self._number = line.fileno()

    def lost(self) -> None:
        """Let a waiting writer go on, to learn that the line is gone.

        The transport calls this before it closes its socket: afterwards the number may be another
        line's.
        """
        self._number = NO_NUMBER
        self.resume()
        self._busy()

    def pause(self) -> None:
        """Take note that the kernel is full."""
        self._is_free = False
        self._writable.clear()
        self._busy()

    def closing(self) -> None:
        """Take note that nothing more must be written: the protocol has said goodbye."""
        self._number = NO_NUMBER
        self._busy()

    def resume(self) -> None:
        """Take note that the kernel has taken everything."""
        self._is_free = True
        self._writable.set()

    # What a client does

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
        """Hand over a whole WebSocket frame as it is."""
        if self._transport and not self.is_closing():
            self._transport.write(frame)

    def direct(self, busy: Callable[[], None]) -> int:
        """Return the number to write whole frames to, until `busy` is called."""
        self._busy = busy
        return self._number

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


def _nobody() -> None:
    """Nobody writes to it directly."""
