"""The socket below a browser client: whether the kernel has taken everything, and whole frames.

Floor 5.
"""

import asyncio
from collections.abc import Callable

__all__ = ["SocketFlow"]


class SocketFlow:
    """Lets a client write whole frames, wait until the kernel has taken everything, or cut it."""

    def __init__(self) -> None:
        self.sink: Callable[[bytes], bool] | None = None
        """Takes each text that came whole."""
        self._transport: asyncio.Transport | None = None
        self._is_free = True
        self._writable = asyncio.Event()
        self._writable.set()

    # What the protocol says

    def made(self, transport: asyncio.Transport) -> None:
        """Take the transport, and let it say so as soon as the kernel is full."""
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
