"""An open TCP connection as a stream, and a base class for transports that use a stream.

Each connection stores received data in one fixed-size buffer. URC does not read from the socket
while the buffer is full, so a flooding robot fills only its own send queue. `write` returns after
the kernel has accepted every byte, so the connection may be closed immediately after the last
write.
"""

import asyncio
import os
import socket
import struct
import sys
from array import array
from collections.abc import Callable
from contextlib import suppress
from typing import cast

from urc.model.payload import Payload
from urc.transports._faults import CLOSED, HUNG_UP, broke
from urc.transports.base import (
    ByteStream,
    PeerClosed,
    SupportsReset,
    TransportError,
    unsent_of,
)

if sys.platform == "linux":
    from fcntl import ioctl
    from termios import TIOCOUTQ

__all__ = [
    "READ_AHEAD_BYTES",
    "TcpStream",
    "StreamTransport",
    "adopt",
    "as_bytes",
    "forget_unsent",
    "tune",
    "unsent_in",
]

READ_AHEAD_BYTES = 65536
"""Size of the receive buffer, in bytes."""

_KEEPALIVE_IDLE_S, _KEEPALIVE_EVERY_S, _KEEPALIVE_COUNT = 5, 2, 3
_UNANSWERED_MS = 5000
"""Timeout for TCP acknowledgements, in milliseconds; the timeout detects half-open connections and
unplugged cables."""
_UNSENT_BYTES = 16384
"""Maximum number of unsent bytes in the kernel; further data would be outdated by the time it was
sent."""
_UNSENT = array("i", [0])
"""Output buffer for the system call that returns the number of unsent bytes."""
_CAN_WRITE = os.name == "posix"
"""Whether sockets are file descriptors on this system."""
_LINGER_NOT = struct.pack("hh" if sys.platform == "win32" else "ii", 1, 0)


class TcpStream(asyncio.BufferedProtocol):
    """One open connection.

    `asyncio.Protocol` is not used, because it would allocate 256 KiB for every read.
    """

    def __init__(self, read_ahead_bytes: int = READ_AHEAD_BYTES) -> None:
        """Initialise an unconnected stream; `adopt` connects it."""
        self._buffer = memoryview(bytearray(read_ahead_bytes))
        self._filled = 0
        self._ended: str | None = None
        """Why the stream ended; None while the connection is open."""
        self._arrived = asyncio.Event()
        self._writable = asyncio.Event()
        self._writable.set()
        self.is_writable = True
        """Whether the kernel has accepted all data."""
        self._gone = asyncio.Event()
        self._transport: asyncio.Transport
        self._line: socket.socket | None = None
        self._number = -1
        """The socket's file descriptor; -1 after the connection has ended."""
        self.sink: Callable[[bytes], bool] | None = None
        """Callback that receives data while the buffer is empty. The callback returns whether it
        accepted the data."""

    # -- called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the asyncio transport of the connection that has opened."""
        # No isinstance check: uvloop's transports have a different base class.
        self._transport = cast("asyncio.Transport", transport)
        self._transport.set_write_buffer_limits(high=0)
        self._line = line = self._transport.get_extra_info("socket")
        self._number = -1 if line is None else line.fileno()

    def get_buffer(self, sizehint: int) -> memoryview:
        """Return the free part of the receive buffer, for the event loop to fill."""
        return self._buffer[self._filled :] if self._filled else self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Pass the received bytes to the sink or store the bytes in the buffer."""
        if self.sink is not None and not self._filled and self.sink(bytes(self._buffer[:nbytes])):
            return
        self._filled += nbytes
        if self._filled == len(self._buffer):
            self._transport.pause_reading()
        self._arrived.set()

    def eof_received(self) -> bool:
        """Record that the stream has ended; the event loop then closes the connection."""
        self.end(HUNG_UP)
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        """Record that the connection has ended."""
        self.end(broke(exc) if exc else HUNG_UP)
        self._gone.set()

    def pause_writing(self) -> None:
        """Block `write`."""
        self.is_writable = False
        self._writable.clear()

    def resume_writing(self) -> None:
        """Let `write` continue."""
        self.is_writable = True
        self._writable.set()

    # -- a `ByteStream`

    async def read(self) -> bytes:
        """Return at least one received byte; raise `PeerClosed` when the stream has ended."""
        while not self._filled:
            if self._ended is not None:
                raise PeerClosed(self._ended)
            self._arrived.clear()
            await self._arrived.wait()
        data = bytes(self._buffer[: self._filled])
        if self._filled == len(self._buffer):
            self._transport.resume_reading()
        self._filled = 0
        return data

    async def write(self, data: bytes) -> None:
        """Wait for buffer space, then pass `data` to the kernel; raise `PeerClosed` on an error."""
        await self._until_writable()
        self._transport.write(data)
        await self._until_writable()

    async def abort(self) -> None:
        """Close the connection immediately, discarding data that the kernel has not accepted."""
        self.end(CLOSED)
        self._transport.abort()
        await self._gone.wait()  # one turn of the event loop; the socket is then closed, too

    # -- further methods

    def offer(self, data: bytes) -> bool:
        """Send `data` unless earlier data is waiting; return whether `data` was accepted."""
        if self._ended is not None or not self.is_writable:
            return False
        if _CAN_WRITE and not self._transport.get_write_buffer_size():
            # Write to the kernel directly: the event loop would take longer than the rest of a
            # tick.
            try:
                taken = os.write(self._number, data)
            except OSError:  # full or broken: the event loop handles both
                taken = 0
            if taken == len(data):
                return True
            data = data[taken:]
        self._transport.write(data)
        return True

    @property
    def has_ended(self) -> bool:
        """Whether both directions of the connection have ended."""
        return self._ended is not None

    def ends(self) -> tuple[str, str]:
        """Return the IP addresses of this computer's end and of the peer's end.

        Raises:
            OSError: the connection has ended.
        """
        if self._line is None:
            raise OSError("the connection has no socket")
        return self._line.getsockname()[0], self._line.getpeername()[0]

    def unsent(self) -> int:
        """Return the number of bytes that the other side has not acknowledged."""
        # Called before each motion: a writable connection's own buffer is empty.
        waiting = 0 if self._writable.is_set() else self._transport.get_write_buffer_size()
        return waiting if self._line is None else waiting + unsent_in(self._line)

    async def reset(self) -> None:
        """Close immediately and discard unsent data in the kernel, so that no data arrives late."""
        self.drop()
        await self._gone.wait()

    def drop(self) -> None:
        """Close the connection like `reset`, without waiting until the socket is closed."""
        line: socket.socket | None = self._transport.get_extra_info("socket")
        if line is not None:
            forget_unsent(line)
        self.end(CLOSED)
        self._transport.abort()

    def end(self, why: str) -> None:
        """Record why the stream ended, unless already recorded, and wake all waiting tasks."""
        if self._ended is None:
            self._ended = why
        self._arrived.set()
        self.resume_writing()

    async def _until_writable(self) -> None:
        await self._writable.wait()
        if self._ended is not None:
            raise PeerClosed(self._ended)


class StreamTransport:
    """The transport methods that need only an open stream, as a base class for transports."""

    def __init__(self) -> None:
        self._stream: ByteStream | None = None

    async def receive(self) -> bytes:
        """Return at least one received byte; raise `PeerClosed` when the stream has ended."""
        if self._stream is None:
            raise PeerClosed(CLOSED)
        return await self._stream.read()

    async def send(self, data: Payload) -> None:
        """Wait for buffer space, then pass `data` to the kernel; raise `PeerClosed` on an error."""
        if self._stream is None:
            raise PeerClosed(CLOSED)
        await self._stream.write(as_bytes(data))

    async def close(self) -> None:
        """Close the connection immediately, discarding unsent data.

        The method never raises and may be called twice.
        """
        stream, self._stream = self._stream, None
        if stream is not None:
            await stream.abort()

    def unsent(self) -> int:
        """Return the number of bytes that the other side has not acknowledged.

        The result is 0 through a tunnel, and on systems without this information.
        """
        return unsent_of(self._stream)

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        stream = self._stream
        if stream is not None and isinstance(stream, SupportsReset):
            self._stream = None
            await stream.reset()
        else:
            await self.close()


async def adopt(line: socket.socket, read_ahead_bytes: int = READ_AHEAD_BYTES) -> TcpStream:
    """Return a stream for a connected socket; the stream takes ownership of the socket."""
    loop = asyncio.get_running_loop()
    _, stream = await loop.create_connection(lambda: TcpStream(read_ahead_bytes), sock=line)
    return stream


def tune(line: socket.socket) -> None:
    """Set socket options that disable delays, limit unsent data, and detect a lost peer."""
    line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name, value in (
        ("TCP_KEEPIDLE", _KEEPALIVE_IDLE_S),
        ("TCP_KEEPINTVL", _KEEPALIVE_EVERY_S),
        ("TCP_KEEPCNT", _KEEPALIVE_COUNT),
        ("TCP_USER_TIMEOUT", _UNANSWERED_MS),
        ("TCP_NOTSENT_LOWAT", _UNSENT_BYTES),
    ):
        option = getattr(socket, name, None)
        if option is not None:
            with suppress(OSError):  # supported by Python, but not by this kernel
                line.setsockopt(socket.IPPROTO_TCP, option, value)


def as_bytes(payload: Payload) -> bytes:
    """Return a payload that consists of bytes.

    Raises:
        TransportError: the payload is an envelope.
    """
    if isinstance(payload, bytes):
        return payload
    raise TransportError(f"this transport carries bytes and cannot {payload.verb}")


def forget_unsent(line: socket.socket) -> None:
    """Make the closing of the socket `line` reset the connection and discard unsent data."""
    with suppress(OSError, ValueError):  # already closed; uvloop raises ValueError
        line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_NOT)


def unsent_in(line: socket.socket) -> int:
    """Return the number of bytes in the kernel that the other side has not acknowledged.

    The result is 0 if the number is unknown, and 1 for a closed socket, whose last bytes may not
    have arrived.
    """
    number = line.fileno()
    if sys.platform == "linux":
        if number < 0:
            return 1
        with suppress(OSError):
            ioctl(number, TIOCOUTQ, _UNSENT)  # SIOCOUTQ has the same number
            return _UNSENT[0]
    return 0
