"""The socket below an SSH connection.

asyncssh writes to its transport without ever asking whether there is room, so a robot that takes
nothing would fill our memory. This protocol sits between the two and knows when the kernel is full.
"""

import asyncio
import socket
from collections.abc import Callable
from typing import Any

import asyncssh

from urc.transports._faults import CLOSED, HUNG_UP, broke, one_line
from urc.transports._stream import forget_unsent, unsent_in

__all__ = ["Through", "Wire", "why_lost"]

_READ_BYTES = 65536
UNTAKEN_BYTES = 8_388_608
"""What a server may make us say without taking any of it: more than it lets a channel send."""
_LAST_TURNS = 10
"""Turns of the loop that asyncssh has for the last bytes before it is told that no more come. It
reads some packets in tasks, and whoever refuses us often closes right behind the packet that tells
why: told of the end before such a task is done, it would know no reason."""


def why_lost(exc: Exception | None) -> str:
    """Return one line about the end of a connection, in the words of all transports."""
    if exc is None or isinstance(exc, asyncssh.ConnectionLost):
        if "keepalive" in str(exc):
            return "the line broke (the robot does not answer any more)"
        return HUNG_UP
    if isinstance(exc, asyncssh.DisconnectError):
        return f"{HUNG_UP} ({one_line(exc.reason.lower())})"
    return broke(exc)


class Wire(asyncio.BufferedProtocol):
    """Passes bytes to and from asyncssh's connection; see `is_full` and `fault`."""

    def __init__(self, inner: asyncio.Protocol) -> None:
        """Stand below `inner`."""
        self._inner = inner
        self._buffer = memoryview(bytearray(_READ_BYTES))
        self._room = asyncio.Event()
        self._room.set()
        self._gone = asyncio.Event()
        self._transport: Any
        self._untaken = 0
        self.fault = ""
        """Why the connection as a whole is over; "" while it is up."""

    def unsent(self) -> int:
        """Return the bytes handed over that the server has not acknowledged."""
        count: int = self._transport.get_write_buffer_size()  # a channel has it, too
        line = self._transport.get_extra_info("socket")
        return count + (unsent_in(line) if line is not None and line.fileno() >= 0 else 0)

    @property
    def is_full(self) -> bool:
        """Whether the kernel has not taken everything yet."""
        return not self._room.is_set()

    async def drained(self) -> None:
        """Wait until the kernel has everything, or the connection is over."""
        await self._room.wait()

    async def gone(self) -> None:
        """Wait until the socket is closed."""
        await self._gone.wait()

    def end(self, reason: str) -> None:
        """Note why the connection is over; the first reason counts."""
        self.fault = self.fault or reason
        self._room.set()

    def reset(self) -> None:
        """Close at once, and let the kernel forget what it has not sent: nothing comes late."""
        line = self._transport.get_extra_info("socket")
        if line is not None and line.fileno() >= 0:
            forget_unsent(line)
        self.end(CLOSED)
        self._transport.abort()

    # -- called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Let asyncssh begin."""
        self._transport = transport
        self._transport.set_write_buffer_limits(high=0)
        self._inner.connection_made(transport)

    def get_buffer(self, sizehint: int) -> memoryview:
        """Return where to read to."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Pass on what was read."""
        self.passes(bytes(self._buffer[:nbytes]))

    def passes(self, data: bytes) -> None:
        """Pass on what came, and end the line when it makes us answer without end."""
        before = self._transport.get_write_buffer_size()
        self._inner.data_received(data)
        after = self._transport.get_write_buffer_size()
        self._untaken = self._untaken + after - before if before else after
        if self._untaken > UNTAKEN_BYTES:
            self.end("the line broke (the robot asks, and takes none of the answers)")
            self._transport.abort()

    def eof_received(self) -> bool:
        """Pass it on, once what came before is read; then the socket is closed."""
        self._at_last(self._no_more_comes)
        return True  # stay open until then

    def connection_lost(self, exc: Exception | None) -> None:
        """Pass it on, once what came before is read, and let go of who waits."""
        self._at_last(self._lost, exc)

    def pause_writing(self) -> None:
        """The kernel is full."""
        self._room.clear()

    def resume_writing(self) -> None:
        """The kernel has taken everything."""
        self._room.set()

    # -- the end

    def _at_last(self, act: Callable[..., None], *words: Any, turns: int = _LAST_TURNS) -> None:
        """Call `act` some turns of the loop from now: of two, the first one first."""
        loop = asyncio.get_running_loop()
        if turns:
            loop.call_soon(lambda: self._at_last(act, *words, turns=turns - 1))
        else:
            act(*words)

    def _no_more_comes(self) -> None:
        self._inner.eof_received()
        self.end(HUNG_UP)  # unless asyncssh knew better: what breaks from here on follows from it
        self._transport.close()

    def _lost(self, exc: Exception | None) -> None:
        self.end(why_lost(exc))
        self._inner.connection_lost(exc)
        self._gone.set()


class Through:
    """What asyncssh calls a tunnel: hands it the connection that is to carry the SSH one."""

    def __init__(self, line: socket.socket | asyncssh.SSHClientConnection) -> None:
        """Go over a connected socket, or over another SSH connection that forwards."""
        self._line = line
        self._is_used = False
        self.wire: Wire

    async def create_connection(
        self, factory: Callable[[], Any], host: str, port: int
    ) -> tuple[object, object]:
        """Return the transport and the protocol that `factory` makes, connected."""
        inner = factory()
        self.wire = Wire(inner)
        if isinstance(self._line, socket.socket):
            loop = asyncio.get_running_loop()
            transport, _ = await loop.create_connection(lambda: self.wire, sock=self._line)
            self._is_used = True
            return transport, inner
        channel, _ = await self._line.create_connection(
            lambda: _Nested(self.wire), host, port, encoding=None
        )
        return channel, inner

    def give_up_unused(self) -> None:
        """Close the socket, unless it has become a connection's own."""
        if isinstance(self._line, socket.socket) and not self._is_used:
            self._line.close()


class _Nested(asyncssh.SSHTCPSession[bytes]):
    """A channel of another SSH connection as what is below this one."""

    def __init__(self, wire: Wire) -> None:
        self._wire = wire

    def connection_made(self, chan: asyncssh.SSHTCPChannel[bytes]) -> None:
        self._wire.connection_made(chan)  # type: ignore[arg-type] # as good as a transport

    def data_received(self, data: bytes, datatype: int | None) -> None:
        self._wire.passes(data)

    def eof_received(self) -> bool:
        return self._wire.eof_received()

    def connection_lost(self, exc: Exception | None) -> None:
        self._wire.connection_lost(exc)

    def pause_writing(self) -> None:
        self._wire.pause_writing()

    def resume_writing(self) -> None:
        self._wire.resume_writing()
