"""One TLS connection over an asyncio transport, without its own buffer.

Layer 5. The standard library's `ssl.SSLObject` encrypts the data. An event loop's own TLS layer has
a buffer above the TCP transport and reports a full buffer one write too late. The dashboard would
then write one more frame, which becomes outdated in the buffer. This class passes each write to TCP
immediately, so TCP's callbacks arrive at the right time. While reading is paused, received data
stays in the kernel.
"""

import asyncio
import contextlib
import ssl
from collections.abc import Callable
from typing import Any

__all__ = ["READ_BYTES", "TlsConnection"]

READ_BYTES = 64 * 1024
"""Maximum number of decrypted bytes passed to the upper protocol in one call."""
HANDSHAKE_BYTES = 64 * 1024
"""Maximum number of received bytes that can wait for the next step of a handshake."""


class TlsConnection(asyncio.Transport, asyncio.Protocol):
    """Acts as the protocol of the TCP transport, and as the transport of the upper protocol."""

    def __init__(
        self,
        tcp: asyncio.Transport,
        context: ssl.SSLContext,
        make: Callable[[], asyncio.Protocol],
        on_data: Callable[[], None],
        on_end: Callable[[], None],
        *,
        hostname: str | None = None,
    ) -> None:
        """Prepare the handshake.

        Args:
            tcp: an open transport; this connection becomes its protocol.
            context: certificate and options of this end.
            make: function that creates the upper protocol after the handshake.
            on_data: callback for received handshake data, which `continue_handshake` processes.
            on_end: callback that is called when the handshake has succeeded, has failed or has lost
                its connection.
            hostname: name of the server, if this end is the client; None if this end is the server.
        """
        super().__init__()
        self._tcp = tcp
        self._make = make
        self._on_data = on_data
        self._on_end = on_end
        self.has_replied = False
        """Whether the server has replied to a complete first message from the client."""
        self._context = context
        self._in = ssl.MemoryBIO()
        self._out = ssl.MemoryBIO()
        self._tls = context.wrap_bio(
            self._in, self._out, server_side=hostname is None, server_hostname=hostname
        )
        self._protocol: asyncio.BaseProtocol | None = None
        """The upper protocol; None before the handshake and after the connection has ended."""
        self._is_ready = False
        self._is_reading = True
        self._is_closing = False
        self.fault = ""
        """Why TLS ended the connection; "" before, and for an ordinary end."""
        self._loop = asyncio.get_running_loop()

    # Called by TCP

    def data_received(self, data: bytes) -> None:
        """Decrypt received bytes."""
        self._in.write(data)
        if self._is_ready:
            self._read()
        elif self._in.pending > HANDSHAKE_BYTES:
            self.abort()
        else:
            self._on_data()

    def eof_received(self) -> bool | None:
        """Close the connection, because data without a TLS close message may be incomplete."""
        self._in.write_eof()
        if isinstance(self._protocol, asyncio.Protocol) and not self._is_closing:
            self._protocol.eof_received()
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        """Report the end of the connection to the upper protocol."""
        self._is_closing = True
        if not self._is_ready:
            self._on_end()
        protocol, self._protocol = self._protocol, None
        if protocol is not None:
            protocol.connection_lost(exc)

    def pause_writing(self) -> None:
        """Notify the upper protocol that the kernel accepts no more data."""
        if self._protocol is not None:
            self._protocol.pause_writing()

    def resume_writing(self) -> None:
        """Notify the upper protocol that the kernel has accepted all bytes."""
        if self._protocol is not None:
            self._protocol.resume_writing()

    def continue_handshake(self) -> None:
        """Process the received handshake data; this takes long because of the cryptography."""
        if self._is_closing or self._is_ready:
            return
        try:
            self._tls.do_handshake()
        except ssl.SSLWantReadError:
            self.has_replied = self.has_replied or self._out.pending > 0
            self._flush()
            return
        except (ssl.SSLError, ssl.CertificateError) as fault:
            self._fail(fault)
            return
        self._flush()
        self._is_ready = True
        self._on_end()
        self._protocol = protocol = self._make()
        protocol.connection_made(self)
        self._read()

    def _read(self) -> None:
        while self._is_reading and not self._is_closing:
            try:
                data = self._tls.read(READ_BYTES)
            except ssl.SSLWantReadError:
                break
            except ssl.SSLError as fault:
                self._fail(fault)
                return
            if not data:  # the client has closed the TLS connection
                if isinstance(self._protocol, asyncio.Protocol):
                    self._protocol.eof_received()
                self.close()
                return
            if isinstance(self._protocol, asyncio.Protocol):
                self._protocol.data_received(data)
        self._flush()  # replies of the TLS protocol itself, such as a key update

    def _fail(self, fault: ssl.SSLError | ssl.CertificateError) -> None:
        """Send the TLS alert about the failure and close the connection."""
        self.fault = getattr(fault, "verify_message", "") or fault.reason or str(fault)
        self._flush()
        self._is_closing = True
        self._tcp.close()

    def _flush(self) -> None:
        if self._out.pending and not self._tcp.is_closing():
            self._tcp.write(self._out.read())

    @property
    def is_ready(self) -> bool:
        """Whether the handshake has succeeded."""
        return self._is_ready

    # Called by the upper protocol

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        """Return information about the connection, such as ``peername`` or ``sslcontext``."""
        if name == "sslcontext":
            return self._context
        if name == "ssl_object":
            return self._tls
        return self._tcp.get_extra_info(name, default)

    def get_protocol(self) -> asyncio.BaseProtocol:
        """Return the upper protocol."""
        return self._protocol or self

    def set_protocol(self, protocol: asyncio.BaseProtocol) -> None:
        """Replace the upper protocol, for example when a WebSocket starts."""
        self._protocol = protocol

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Encrypt data and write it to TCP."""
        if self._is_closing or not data:
            return
        try:
            self._tls.write(data)
        except ssl.SSLError as fault:
            self._fail(fault)
        else:
            self._flush()

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """Set the limits of TCP's buffer, in encrypted bytes."""
        self._tcp.set_write_buffer_limits(high, low)

    def get_write_buffer_size(self) -> int:
        """Return the number of encrypted bytes that the kernel has not accepted yet."""
        return self._tcp.get_write_buffer_size()

    def pause_reading(self) -> None:
        """Pause reading; further data stays in the kernel's buffer."""
        self._is_reading = False
        self._tcp.pause_reading()

    def resume_reading(self) -> None:
        """Resume reading, beginning with the remaining bytes of the last packet."""
        if not self._is_reading:
            self._is_reading = True
            self._loop.call_soon(self._resumed)

    def _resumed(self) -> None:
        if self._is_ready:
            self._read()
        if self._is_reading and not self._tcp.is_closing():
            self._tcp.resume_reading()

    def is_reading(self) -> bool:
        """Return whether data is being read."""
        return self._is_reading

    def is_closing(self) -> bool:
        """Return whether the connection is closing or closed."""
        return self._is_closing or self._tcp.is_closing()

    def can_write_eof(self) -> bool:
        """Return False, because TLS closes both directions together."""
        return False

    def close(self) -> None:
        """Close the connection after sending all data, without waiting for the client's reply."""
        if self._is_closing:
            return
        self._is_closing = True
        if self._is_ready:
            # The closing message has been written; the client's reply is not awaited.
            with contextlib.suppress(ssl.SSLError):
                self._tls.unwrap()
            self._flush()
        self._tcp.close()

    def abort(self) -> None:
        """Close the connection immediately."""
        self._is_closing = True
        self._tcp.abort()
