"""An SSH channel as a byte stream.

Received data is buffered up to `READ_AHEAD_BYTES`. While the buffer is full, URC does not read from
the channel, and SSH flow control stops the sender. `write` returns after the kernel has accepted
every byte.
"""

import asyncio
from collections import deque

import asyncssh
from asyncssh.constants import EXTENDED_DATA_STDERR

from urc.transports._faults import CLOSED, HUNG_UP, one_line
from urc.transports.base import PeerClosed
from urc.transports.ssh_wire import SshSocket, why_lost

__all__ = ["MAX_PACKET", "WINDOW", "SshChannel"]

READ_AHEAD_BYTES = 65536
"""Size of the receive buffer, in bytes."""
WINDOW = 262_144
"""SSH window size of the channel, excluding the receive buffer, in bytes."""
MAX_PACKET = 32768
_CLOSES_WITHIN_S = 1.0
"""Maximum wait for a program to exit after closing its output, in seconds."""
_LAST_WORDS = 200
"""Maximum number of standard error bytes to quote in the message about a program's end."""


class SshChannel(asyncssh.SSHClientSession[bytes], asyncssh.SSHTCPSession[bytes]):
    """A channel for a shell, a program, or a forwarded connection."""

    def __init__(self, wire: SshSocket, program: str = "") -> None:
        """Initialise a channel.

        Args:
            wire: the SSH connection's socket; `write` waits while the socket's buffer is full.
            program: the program's name in messages, such as ``the shell``; "" for a forwarded
                connection.
        """
        self._wire = wire
        self._program = program
        self._parts: deque[bytes] = deque()
        self._held = 0
        self._is_read = True
        self._last_words = b""
        self._outcome = ""
        self._ended: str | None = None
        """Why the channel ended; None while the channel is open."""
        self._late: asyncio.TimerHandle | None = None
        self._arrived = asyncio.Event()
        self._writable = asyncio.Event()
        self._writable.set()
        self._channel: asyncssh.SSHClientChannel[bytes] | asyncssh.SSHTCPChannel[bytes]

    # -- called by asyncssh

    def connection_made(self, chan: object) -> None:
        """Store the asyncssh channel when it opens."""
        self._channel = chan  # type: ignore[assignment] # of either base
        self._channel.set_write_buffer_limits(high=0)

    def data_received(self, data: bytes, datatype: int | None) -> None:
        """Store received data in the buffer, except for standard error."""
        if datatype == EXTENDED_DATA_STDERR:
            self._last_words = (self._last_words + data)[-_LAST_WORDS:]
            return
        self._parts.append(data)
        self._held += len(data)
        if self._held >= READ_AHEAD_BYTES and self._is_read:
            self._is_read = False
            self._channel.pause_reading()
        self._arrived.set()

    def exit_status_received(self, status: int) -> None:
        """Record the program's exit status."""
        self._outcome = f"{self._program} ended with status {status}"

    def exit_signal_received(self, signal: str, core_dumped: bool, msg: str, lang: str) -> None:
        """Record the signal that ended the program."""
        self._outcome = f"{self._program} was ended by signal {one_line(signal, 20)}"

    def eof_received(self) -> bool:
        """Handle the end of the output; for a program, wait for its exit status."""
        if not self._program:
            self._end(HUNG_UP)
        elif self._late is None:
            loop = asyncio.get_running_loop()
            self._late = loop.call_later(_CLOSES_WITHIN_S, self._end, self._farewell())
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        """Record that the channel or its connection has ended."""
        if exc is not None:
            self._wire.end(why_lost(exc))
        self._end(self._wire.fault or self._farewell())

    def pause_writing(self) -> None:
        """Make `write` wait while the other side accepts no data."""
        self._writable.clear()

    def resume_writing(self) -> None:
        """Unblock `write`."""
        self._writable.set()

    # -- a `ByteStream`

    async def read(self) -> bytes:
        """Return at least one received byte; raise `PeerClosed` when the stream has ended."""
        while not self._parts:
            if self._ended is not None:
                raise PeerClosed(self._ended)
            self._arrived.clear()
            await self._arrived.wait()
        data = self._parts.popleft() if len(self._parts) == 1 else b"".join(self._parts)
        self._parts.clear()
        self._held = 0
        if not self._is_read:
            self._is_read = True
            self._channel.resume_reading()
        return data

    async def write(self, data: bytes) -> None:
        """Wait for buffer space, then send `data`; raise `PeerClosed` on an error."""
        await self._until_writable()
        try:
            self._channel.write(data)
        except OSError as closed:  # closed by either side
            raise PeerClosed(self._ended or self._farewell()) from closed
        await self._until_writable()

    async def abort(self) -> None:
        """Close immediately. The method never raises and may be called twice."""
        self.discard()

    def discard(self) -> None:
        """Close immediately."""
        self._end(CLOSED)
        self._channel.abort()

    def unsent(self) -> int:
        """Return the number of bytes that the server has not acknowledged.

        The number includes the unacknowledged bytes of all channels on the SSH connection.
        """
        return self._channel.get_write_buffer_size() + self._wire.unsent()

    async def _until_writable(self) -> None:
        while self._ended is None:
            if not self._writable.is_set():
                await self._writable.wait()
            elif self._wire.is_full:
                await self._wire.drained()
            else:
                break
        if self._ended is not None or self._wire.fault:
            raise PeerClosed(self._ended or self._wire.fault)

    def _farewell(self) -> str:
        said = self._last_words.decode("utf-8", "replace").strip().splitlines()
        if not self._program or not (self._outcome or said):
            return HUNG_UP
        words = f" ({one_line(said[-1])})" if said else ""
        return (self._outcome or f"{self._program} closed the connection") + words

    def _end(self, reason: str) -> None:
        if self._late is not None:
            self._late.cancel()
        if self._ended is None:
            self._ended = reason
        self._arrived.set()
        self._writable.set()
