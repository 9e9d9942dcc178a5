"""An open serialx port as a byte stream. This module is imported only when a port is opened."""

import asyncio
import socket
import sys
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any, cast

from serialx import BaseSerialTransport, SerialException, create_serial_connection
from serialx.platforms.serial_rfc2217 import RFC2217SerialTransport
from serialx.platforms.serial_rfc2217.types import (
    Rfc2217Command,
    SetLinestateMaskCmd,
    SetModemstateMaskCmd,
)

from urc.transports._faults import CLOSED, HUNG_UP, broke, reason
from urc.transports._stream import READ_AHEAD_BYTES, forget_unsent, unsent_in
from urc.transports.base import PeerClosed

__all__ = ["FAULTS", "SerialStream", "open_port"]

FAULTS: tuple[type[Exception], ...] = (OSError, SerialException, ValueError, LookupError)
"""Exceptions that serialx raises; a `LookupError` means that a server sent invalid RFC 2217
data."""
UNTAKEN_BYTES = 1_048_576
"""Maximum number of unsent bytes to an RFC 2217 server; beyond this limit, the connection ends."""
if sys.platform != "win32":
    import termios

    FAULTS = (*FAULTS, termios.error)
_KEPT_OPTIONS, _AT_ONCE = 64, 4096
"""Maximum number of unsolicited RFC 2217 options to keep. `_AT_ONCE` is the maximum number of bytes
to process in one step.
"""
_DRAIN_S, _LOOK_S = 0.3, 0.01
"""Maximum wait for unsent bytes before a port closes, in seconds. `_LOOK_S` is the interval between
checks for unsent bytes."""


async def open_port(
    port: str, arguments: Mapping[str, object], tune: Callable[[socket.socket], None]
) -> "SerialStream":
    """Open and configure `port`; discard input that arrived earlier.

    Args:
        port: a device path or name, or an address ``rfc2217://HOST:PORT``.
        arguments: port settings, keyed by the names that serialx uses.
        tune: function that configures a network port's socket.

    Raises:
        OSError, SerialException, termios.error, ValueError: the port cannot be opened or
            configured.
    """
    loop = asyncio.get_running_loop()
    stream = SerialStream()
    kind = _Rfc2217 if port.startswith("rfc2217://") else None
    transport, _ = await create_serial_connection(
        loop, lambda: stream, port, transport_cls=kind, **cast("dict[str, Any]", arguments)
    )
    tunnel: asyncio.Transport | None = getattr(transport, "_tcp_transport", None)
    if tunnel is not None:  # the library offers no other access to its socket
        stream.socket = tunnel.get_extra_info("socket")
        tune(stream.socket)
    else:
        with suppress(*FAULTS):
            transport.serial.reset_read_buffer()
    return stream


class _Rfc2217(RFC2217SerialTransport):
    """An RFC 2217 connection that does not wait for the server to confirm notification masks.

    The common server ser2net never confirms these masks, so the library would wait until its
    timeout.
    """

    def _data_received(self, data: bytes) -> None:
        """Process received data; end the connection on invalid data or too many unsent replies."""
        for start in range(0, len(data), _AT_ONCE):
            line, serial = self._tcp_transport, self._serial
            if line is None or serial is None or line.is_closing():
                return
            try:
                super()._data_received(data[start : start + _AT_ONCE])
            except Exception as fault:  # the library hardly validates its input
                self._fail(f"the server does not speak RFC 2217 ({reason(fault)})")
                return
            # Discard old unsolicited options: the library would keep them and search them each
            # time.
            del serial._engine._pending_telnet[:-_KEPT_OPTIONS]  # noqa: SLF001 - no public way
            if line.get_write_buffer_size() > UNTAKEN_BYTES:
                self._fail("the server does not read the replies")

    def _fail(self, why: str) -> None:
        if self._tcp_transport is not None:
            self._tcp_transport.abort()
        self._tcp_connection_lost(OSError(why))

    async def _send_and_wait(self, cmd: Rfc2217Command) -> Rfc2217Command:
        if isinstance(cmd, SetLinestateMaskCmd | SetModemstateMaskCmd):
            self._send_command(cmd)
            return cmd
        return await super()._send_and_wait(cmd)


class SerialStream(asyncio.Protocol):
    """A `ByteStream` over a serial port, which also provides `unsent` and `reset`.

    The port is read only while a task reads the stream.
    """

    def __init__(self) -> None:
        self._arrived_bytes = bytearray()
        self._is_paused = False
        self._ended: str | None = None
        self._arrived = asyncio.Event()
        self._writable = asyncio.Event()
        self._writable.set()
        self._gone = asyncio.Event()
        self._transport: BaseSerialTransport
        self.socket: socket.socket | None = None
        """The socket for a port on a server; None for a local port."""

    # -- called by the library

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Store the asyncio transport of the port that has opened."""
        assert isinstance(transport, BaseSerialTransport)  # noqa: S101 - guaranteed by the library
        self._transport = transport
        transport.set_write_buffer_limits(high=0)

    def data_received(self, data: bytes) -> None:
        """Store received bytes in the buffer."""
        self._arrived_bytes += data
        if len(self._arrived_bytes) >= READ_AHEAD_BYTES and not self._is_paused:
            self._is_paused = True
            self._transport.pause_reading()
        self._arrived.set()

    def connection_lost(self, exc: Exception | None) -> None:
        """Record that the port was closed or unplugged."""
        self._end(broke(exc) if exc else HUNG_UP)
        self._gone.set()

    def pause_writing(self) -> None:
        """Block `write`."""
        self._writable.clear()

    def resume_writing(self) -> None:
        """Let `write` continue."""
        self._writable.set()

    # -- a `ByteStream`

    async def read(self) -> bytes:
        """Return at least one received byte; raise `PeerClosed` when the stream has ended."""
        while not self._arrived_bytes:
            if self._ended is not None:
                raise PeerClosed(self._ended)
            self._arrived.clear()
            await self._arrived.wait()
        data = bytes(self._arrived_bytes)
        self._arrived_bytes.clear()
        if self._is_paused and self._ended is None:
            self._is_paused = False
            self._transport.resume_reading()
        return data

    async def write(self, data: bytes) -> None:
        """Wait for buffer space, then pass `data` to the system; raise `PeerClosed` on an error."""
        await self._until_writable()
        try:
            self._transport.write(data)
        except FAULTS as fault:
            self._end(broke(fault))
        await self._until_writable()

    async def abort(self) -> None:
        """Wait briefly for unsent bytes to be transmitted, then close the port. Never raises."""
        with suppress(TimeoutError):
            async with asyncio.timeout(_DRAIN_S):
                # The system does not report when the last byte has been transmitted.
                while self._ended is None and self._writable.is_set() and self.unsent():  # noqa: ASYNC110
                    await asyncio.sleep(_LOOK_S)
        # A pseudo-terminal reports no unsent bytes, but discards unread bytes.
        if self.socket is None and self.unsent():
            self._forget_unsent()
        await self._close()

    async def reset(self) -> None:
        """Close the port immediately and discard the unsent bytes. Never raises."""
        self._forget_unsent()
        await self._close()

    def unsent(self) -> int:
        """Return the number of bytes that have not been transmitted yet."""
        waiting = self._transport.get_write_buffer_size()
        if self.socket is not None:
            return waiting + (unsent_in(self.socket) if self.socket.fileno() >= 0 else 0)
        with suppress(*FAULTS, NotImplementedError):
            waiting += self._transport.serial.num_unwritten_bytes()
        return waiting

    def _forget_unsent(self) -> None:
        """Discard the system's output buffer, which would delay closing on a slow port."""
        if self.socket is not None:
            forget_unsent(self.socket)
        else:
            with suppress(*FAULTS, NotImplementedError):
                self._transport.serial.reset_write_buffer()

    async def _close(self) -> None:
        self._end(CLOSED)
        self._transport.abort()
        await self._gone.wait()

    async def _until_writable(self) -> None:
        await self._writable.wait()
        if self._ended is not None:
            raise PeerClosed(self._ended)

    def _end(self, why: str) -> None:
        if self._ended is None:
            self._ended = why
        self._arrived.set()
        self._writable.set()
