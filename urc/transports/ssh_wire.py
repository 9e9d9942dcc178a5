"""The socket that carries an SSH connection, with flow control.

asyncssh writes without checking for buffer space, so a stalled robot would fill URC's memory. The
protocol in this module connects asyncssh to the socket and detects a full kernel buffer.
"""

import asyncio
import socket
from collections.abc import Callable
from typing import Any

import asyncssh

from urc.transports._faults import CLOSED, HUNG_UP, broke, one_line
from urc.transports._stream import forget_unsent, unsent_in

__all__ = ["TunnelAdapter", "SshSocket", "why_lost"]

_READ_BYTES = 65536
UNTAKEN_BYTES = 8_388_608
"""Maximum number of unsent bytes in replies to a server; larger than a channel's window."""
_LAST_TURNS = 10
"""Number of event loop turns between the last bytes and the end of the stream. The delay is needed
because asyncssh reads some packets in tasks. Servers often close the connection directly after a
refusal; the delay lets asyncssh read the reason."""


def why_lost(exc: Exception | None) -> str:
    """Return the one-line reason for a lost connection, worded as in other transports."""
    if exc is None or isinstance(exc, asyncssh.ConnectionLost):
        if "keepalive" in str(exc):
            return "the connection broke (the robot no longer answers)"
        return HUNG_UP
    if isinstance(exc, asyncssh.DisconnectError):
        return f"{HUNG_UP} ({one_line(exc.reason.lower())})"
    return broke(exc)


class SshSocket(asyncio.BufferedProtocol):
    """A protocol that passes bytes between asyncssh and the socket; see `is_full` and `fault`."""

    def __init__(self, inner: asyncio.Protocol) -> None:
        """Initialise a socket for the asyncssh protocol `inner`."""
        self._inner = inner
        self._buffer = memoryview(bytearray(_READ_BYTES))
        self._room = asyncio.Event()
        self._room.set()
        self._gone = asyncio.Event()
        self._transport: Any
        self._untaken = 0
        self.fault = ""
        """Why the SSH connection ended; "" while the connection is open."""

    def unsent(self) -> int:
        """Return the number of bytes that the server has not acknowledged."""
        count: int = self._transport.get_write_buffer_size()  # channels have this method, too
        line = self._transport.get_extra_info("socket")
        return count + (unsent_in(line) if line is not None and line.fileno() >= 0 else 0)

    @property
    def is_full(self) -> bool:
        """Whether some data has not been passed to the kernel yet."""
        return not self._room.is_set()

    async def drained(self) -> None:
        """Wait until the kernel has accepted all data or the connection has ended."""
        await self._room.wait()

    async def gone(self) -> None:
        """Wait until the socket is closed."""
        await self._gone.wait()

    def end(self, reason: str) -> None:
        """Record why the connection ended; after several calls, the first reason remains."""
        self.fault = self.fault or reason
        self._room.set()

    def reset(self) -> None:
        """Close immediately and discard unsent data in the kernel, so that no data arrives late."""
        line = self._transport.get_extra_info("socket")
        if line is not None and line.fileno() >= 0:
            forget_unsent(line)
        self.end(CLOSED)
        self._transport.abort()

    # -- called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Tell asyncssh that the connection is open."""
        self._transport = transport
        self._transport.set_write_buffer_limits(high=0)
        self._inner.connection_made(transport)

    def get_buffer(self, sizehint: int) -> memoryview:
        """Return the receive buffer, for the event loop to fill."""
        return self._buffer

    def buffer_updated(self, nbytes: int) -> None:
        """Pass the received bytes to asyncssh."""
        self.passes(bytes(self._buffer[:nbytes]))

    def passes(self, data: bytes) -> None:
        """Pass received data to asyncssh; close the connection after too many unsent replies."""
        before = self._transport.get_write_buffer_size()
        self._inner.data_received(data)
        after = self._transport.get_write_buffer_size()
        self._untaken = self._untaken + after - before if before else after
        if self._untaken > UNTAKEN_BYTES:
            self.end("the connection broke (the robot does not read the replies)")
            self._transport.abort()

    def eof_received(self) -> bool:
        """Pass the end of the stream to asyncssh after all earlier data, then close the socket."""
        self._at_last(self._no_more_comes)
        return True  # stay open until then

    def connection_lost(self, exc: Exception | None) -> None:
        """Report the lost connection to asyncssh after all earlier data; wake waiting tasks."""
        self._at_last(self._lost, exc)

    def pause_writing(self) -> None:
        """Block writers while the kernel accepts no more data."""
        self._room.clear()

    def resume_writing(self) -> None:
        """Unblock writers."""
        self._room.set()

    # -- the end

    def _at_last(self, act: Callable[..., None], *words: Any, turns: int = _LAST_TURNS) -> None:
        """Call `act` after `turns` turns of the event loop; several calls keep their order."""
        loop = asyncio.get_running_loop()
        if turns:
            loop.call_soon(lambda: self._at_last(act, *words, turns=turns - 1))
        else:
            act(*words)

    def _no_more_comes(self) -> None:
        self._inner.eof_received()
        self.end(HUNG_UP)  # unless asyncssh gave a better reason; later errors are consequences
        self._transport.close()

    def _lost(self, exc: Exception | None) -> None:
        self.end(why_lost(exc))
        self._inner.connection_lost(exc)
        self._gone.set()


class TunnelAdapter:
    """An asyncssh tunnel that provides the underlying connection of an SSH connection."""

    def __init__(self, line: socket.socket | asyncssh.SSHClientConnection) -> None:
        """Create a tunnel over a connected socket, or through another SSH connection."""
        self._line = line
        self._is_used = False
        self.wire: SshSocket

    async def create_connection(
        self, factory: Callable[[], Any], host: str, port: int
    ) -> tuple[object, object]:
        """Return a connected transport and the protocol created by `factory`."""
        inner = factory()
        self.wire = SshSocket(inner)
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
        """Close the socket unless a connection is using it."""
        if isinstance(self._line, socket.socket) and not self._is_used:
            self._line.close()


class _Nested(asyncssh.SSHTCPSession[bytes]):
    """A channel of another SSH connection, in the role of a socket."""

    def __init__(self, wire: SshSocket) -> None:
        self._wire = wire

    def connection_made(self, chan: asyncssh.SSHTCPChannel[bytes]) -> None:
        self._wire.connection_made(chan)  # type: ignore[arg-type] # compatible with a transport

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
