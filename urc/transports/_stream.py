"""One open TCP connection, and a line that reads and writes one.

Bytes arrive in one fixed buffer a connection: when it is full the socket is not read until somebody
takes it, so a robot that floods fills its own kernel's queue and not our memory. `put` returns once
the kernel has every byte, so a connection may be closed right after the last one.
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

from urc.model.codec import Payload
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
    "Stream",
    "StreamLine",
    "adopt",
    "as_bytes",
    "forget_unsent",
    "tune",
    "unsent_in",
]

READ_AHEAD_BYTES = 65536
"""Most bytes that are read before somebody takes them."""

_KEEPALIVE_IDLE_S, _KEEPALIVE_EVERY_S, _KEEPALIVE_COUNT = 5, 2, 3
_UNANSWERED_MS = 5000
"""A peer that acknowledges nothing for this long is gone (half-open line, pulled cable)."""
_UNSENT_BYTES = 16384
"""How much unsent data the kernel may hold; more would only grow old there."""
_UNSENT = array("i", [0])
"""Where the system puts its answer."""
_CAN_WRITE = os.name == "posix"
"""Elsewhere a socket is no descriptor."""
_LINGER_NOT = struct.pack("hh" if sys.platform == "win32" else "ii", 1, 0)


class Stream(asyncio.BufferedProtocol):
    """One open connection. The stock `asyncio.Protocol` would allocate 256 KiB for every read."""

    def __init__(self, read_ahead_bytes: int = READ_AHEAD_BYTES) -> None:
        """Made by `adopt`."""
        self._buffer = memoryview(bytearray(read_ahead_bytes))
        self._filled = 0
        self._ended: str | None = None
        """Why nothing more will come; None while the line is up."""
        self._arrived = asyncio.Event()
        self._writable = asyncio.Event()
        self._writable.set()
        self.is_writable = True
        """Whether the kernel has everything that was handed over."""
        self._gone = asyncio.Event()
        self._transport: asyncio.Transport
        self._line: socket.socket | None = None
        self._number = -1
        """Of its descriptor, for as long as nothing has ended."""
        self.sink: Callable[[bytes], bool] | None = None
        """Has what arrives while nothing waits; returns whether it took it."""

    # -- called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Take the connection over."""
        # Not checked: uvloop's transports are none by their class.
        self._transport = cast("asyncio.Transport", transport)
        self._transport.set_write_buffer_limits(high=0)
        self._line = line = self._transport.get_extra_info("socket")
        self._number = -1 if line is None else line.fileno()

    def get_buffer(self, sizehint: int) -> memoryview:
        """Say where the next bytes go."""
        return self._buffer[self._filled :] if self._filled else self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Pass on the bytes that have come, or note that there are some."""
        if self.sink is not None and not self._filled and self.sink(bytes(self._buffer[:nbytes])):
            return
        self._filled += nbytes
        if self._filled == len(self._buffer):
            self._transport.pause_reading()
        self._arrived.set()

    def eof_received(self) -> bool:
        """Note that no more will come, and close."""
        self.end(HUNG_UP)
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        """Note that the connection is over."""
        self.end(broke(exc) if exc else HUNG_UP)
        self._gone.set()

    def pause_writing(self) -> None:
        """Let `put` wait."""
        self.is_writable = False
        self._writable.clear()

    def resume_writing(self) -> None:
        """Let `put` go on."""
        self.is_writable = True
        self._writable.set()

    # -- a `ByteStream`

    async def take(self) -> bytes:
        """Return the next bytes, at least one; raise `PeerClosed` when no more will come."""
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

    async def put(self, data: bytes) -> None:
        """Hand `data` to the kernel, waiting while it is full; raise `PeerClosed` if it broke."""
        await self._until_writable()
        self._transport.write(data)
        await self._until_writable()

    async def abort(self) -> None:
        """Close at once, dropping what the kernel has not been given."""
        self.end(CLOSED)
        self._transport.abort()
        await self._gone.wait()  # one turn of the loop: then the socket is closed, too

    # -- beyond

    def offer(self, data: bytes) -> bool:
        """Hand `data` over if nothing waits before it; return whether it was taken."""
        if self._ended is not None or not self.is_writable:
            return False
        if _CAN_WRITE and not self._transport.get_write_buffer_size():
            # Straight to the kernel: the way through the loop takes longer than the rest of a tick.
            try:
                taken = os.write(self._number, data)
            except OSError:  # it is full, or broken: the loop knows what is to be done
                taken = 0
            if taken == len(data):
                return True
            data = data[taken:]
        self._transport.write(data)
        return True

    @property
    def has_ended(self) -> bool:
        """Whether nothing more will come, and nothing more goes."""
        return self._ended is not None

    def unsent(self) -> int:
        """Return the bytes handed over that the other side has not acknowledged."""
        # Asked before each motion: what is writable has nothing in its own buffer.
        waiting = 0 if self._writable.is_set() else self._transport.get_write_buffer_size()
        return waiting if self._line is None else waiting + unsent_in(self._line)

    async def reset(self) -> None:
        """Close at once and let the kernel forget what it has not sent: nothing comes late."""
        self.drop()
        await self._gone.wait()

    def drop(self) -> None:
        """Do what `reset` does, without waiting until the socket is closed."""
        line: socket.socket | None = self._transport.get_extra_info("socket")
        if line is not None:
            forget_unsent(line)
        self.end(CLOSED)
        self._transport.abort()

    def end(self, why: str) -> None:
        """Let everybody who waits know that it is over; the first reason stays."""
        if self._ended is None:
            self._ended = why
        self._arrived.set()
        self.resume_writing()

    async def _until_writable(self) -> None:
        await self._writable.wait()
        if self._ended is not None:
            raise PeerClosed(self._ended)


class StreamLine:
    """The four members of a transport that need nothing but an open stream, and two more."""

    def __init__(self) -> None:
        self._stream: ByteStream | None = None

    async def receive(self) -> bytes:
        """Return the next bytes, at least one; raise `PeerClosed` when no more will come."""
        if self._stream is None:
            raise PeerClosed(CLOSED)
        return await self._stream.take()

    async def send(self, data: Payload) -> None:
        """Hand `data` to the kernel, waiting while it is full; raise `PeerClosed` when it broke."""
        if self._stream is None:
            raise PeerClosed(CLOSED)
        await self._stream.put(as_bytes(data))

    async def close(self) -> None:
        """Close at once, dropping what is unsent. Never raises, may be called twice."""
        stream, self._stream = self._stream, None
        if stream is not None:
            await stream.abort()

    def unsent(self) -> int:
        """Return the bytes handed over that have not left this machine for good.

        0 where that cannot be known: through another transport, or on a system that does not tell.
        """
        return unsent_of(self._stream)

    async def abort(self) -> None:
        """Close at once; what the robot has not got by now it never gets. Never raises."""
        stream = self._stream
        if stream is not None and isinstance(stream, SupportsReset):
            self._stream = None
            await stream.reset()
        else:
            await self.close()


async def adopt(line: socket.socket, read_ahead_bytes: int = READ_AHEAD_BYTES) -> Stream:
    """Make a stream of a connected socket, which it owns from then on."""
    loop = asyncio.get_running_loop()
    _, stream = await loop.create_connection(lambda: Stream(read_ahead_bytes), sock=line)
    return stream


def tune(line: socket.socket) -> None:
    """Send at once, hold little unsent, and notice a peer that is gone, where the system can."""
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
            with suppress(OSError):  # known to Python, unknown to this kernel
                line.setsockopt(socket.IPPROTO_TCP, option, value)


def as_bytes(payload: Payload) -> bytes:
    """Return a payload of a line that carries bytes.

    Raises:
        TransportError: it is an envelope.
    """
    if isinstance(payload, bytes):
        return payload
    raise TransportError(f"this line carries bytes and cannot {payload.verb}")


def forget_unsent(line: socket.socket) -> None:
    """Let closing `line` reset the connection: what the kernel has not sent is never sent."""
    with suppress(OSError):  # it is gone already
        line.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER_NOT)


def unsent_in(line: socket.socket) -> int:
    """Return the bytes in the kernel that the other side has not acknowledged.

    0 where the system does not tell; 1 for a line that is closed: what became of them is not known.
    """
    if sys.platform != "linux":
        return 0
    number = line.fileno()
    if number < 0:
        return 1
    try:
        ioctl(number, TIOCOUTQ, _UNSENT)  # SIOCOUTQ has its number
    except OSError:
        return 0
    return _UNSENT[0]
