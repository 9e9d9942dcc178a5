"""The WebSocket transport (RFC 6455), based on the library `websockets`.

Each WebSocket message is one payload. The transport reads only a few messages ahead, so a flooding
robot must wait. `send` returns after the kernel has accepted every byte. A lost robot is detected
by missing replies to pings. When a connection ends, its unsent data is discarded.
"""

import asyncio
import socket
import sys
from contextlib import suppress

from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import (
    ConnectionClosed,
    InvalidHandshake,
    InvalidMessage,
    InvalidStatus,
    NegotiationError,
)
from websockets.frames import CloseCode
from websockets.typing import Subprotocol

from urc.model.payload import Payload
from urc.transports._faults import CLOSED, HUNG_UP, broke, late, one_line
from urc.transports._stream import as_bytes
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportError, TransportSetup
from urc.transports.web_dial import Dialer
from urc.transports.web_origin import OptionReader

__all__ = ["WebSocketTransport", "from_setup"]

READ_AHEAD_MESSAGES = 4
"""Maximum number of received messages in the queue."""
MAX_MESSAGE_BYTES = 1_048_576
UNTAKEN_BYTES = 1_048_576
"""Maximum number of unsent bytes in ping replies."""
GATHER_S = 1 / 60
"""Time for which small messages are gathered, in seconds: one display frame."""
GATHER_BYTES = 8192
"""Size of received data that belongs to small messages."""
_WAKING_BYTES = 16384
"""Number of received bytes that end the gathering early, such as an image."""
_CAN_GATHER = sys.platform == "linux"
"""Whether the system reports waiting data when the low-water mark of a socket is lowered."""
_NORMAL = CloseCode.NORMAL_CLOSURE
_CLOSE_S = 0.2
"""Timeout for an orderly close, in seconds; afterwards, the connection is reset."""


class WebSocketTransport:
    """A reusable transport over one WebSocket."""

    def __init__(self, setup: TransportSetup) -> None:
        """Read the options of `setup`, without connecting.

        Raises:
            TransportError: an option is missing or invalid.
        """
        options = OptionReader("websocket", setup.options)
        self._place = options.place("ws")
        self._headers = options.headers()
        credentials = options.credentials(("basic", "bearer"))
        if credentials is not None:
            self._headers["Authorization"] = credentials.header
        self._subprotocols = [Subprotocol(one) for one in options.tokens("subprotocols")]
        self._is_text = options.choice("send_as", ("text", "binary"), "text") == "text"
        self._max_bytes = int(options.number("max_message", MAX_MESSAGE_BYTES, 1, 2**26))
        self._ping_s = options.duration("ping_interval", 5.0, 0.1, 3600)
        self._pong_s = options.duration("ping_timeout", 5.0, 0.1, 3600)
        tls = options.tls(self._place)
        self._dialer = Dialer(self._place, tls=tls, tunnel=setup.tunnel)
        self._socket: ClientConnection | None = None

    @property
    def address(self) -> str:
        """The transport's target as text, such as ``websocket ws://192.168.4.1:80/control``."""
        place = self._place
        return f"websocket ws{'s' * place.is_secure}://{place.authority}{place.path}"

    @property
    def subprotocol(self) -> str | None:
        """Subprotocol that the server has selected; None without a subprotocol."""
        return None if self._socket is None else self._socket.subprotocol

    async def open(self, timeout_s: float) -> None:
        """Connect and do the handshake within `timeout_s` seconds, or raise `ConnectFailed`."""
        await self.close()
        where = self._place.authority
        try:
            async with asyncio.timeout(timeout_s):
                self._socket = await self._connect(timeout_s)
        except TimeoutError as fault:
            raise ConnectFailed(late(where, timeout_s)) from fault
        except (InvalidHandshake, EOFError, OSError) as fault:
            raise ConnectFailed(_refusal(fault, where)) from fault
        finally:
            if self._socket is None:
                await self._dialer.close()

    def gather(self) -> None:
        """Gather small messages from now on, until this connection ends.

        Each wake-up of the event loop costs more than a small message. Messages that arrive within
        `GATHER_S` of an earlier one are therefore received together. The first message after a
        pause, sent messages and the end of the connection do not wait.
        """
        if isinstance(self._socket, _LimitedConnection):
            self._socket.is_gathering = _CAN_GATHER

    async def receive(self) -> bytes:
        """Return the next non-empty message; raise `PeerClosed` when the connection has ended."""
        if self._socket is None:
            raise PeerClosed(CLOSED)
        try:
            while True:
                message = await self._socket.recv(decode=False)
                if message:
                    return message
        except ConnectionClosed as ended:
            raise PeerClosed(_end(ended)) from ended

    async def send(self, data: Payload) -> None:
        """Wait for buffer space, then pass one message to the kernel.

        Raises:
            PeerClosed: the connection broke.
            TransportError: the connection sends text, but `data` is not valid UTF-8.
        """
        message = as_bytes(data)
        if self._is_text:
            try:
                message.decode()
            except UnicodeDecodeError as fault:
                text = "a text message must be valid UTF-8; use send_as: binary for other bytes"
                raise TransportError(text) from fault
        await self.write(message, is_text=self._is_text)

    async def write(self, message: bytes, *, is_text: bool) -> None:
        """Pass one message to the kernel, as text or as binary data.

        Raises:
            PeerClosed: the connection broke.
        """
        if self._socket is None:
            raise PeerClosed(CLOSED)
        try:
            await self._socket.send(message, text=is_text)
        except ConnectionClosed as ended:
            raise PeerClosed(_end(ended)) from ended

    async def close(self) -> None:
        """Send a close message, wait briefly, and close the connection.

        The method never raises and may be called twice.
        """
        connection, self._socket = self._socket, None
        try:
            if connection is not None:
                await _hang_up(connection)
        finally:
            await self._dialer.close()

    async def probe(self) -> None:
        """Send a ping; return as soon as the robot has sent any data."""
        connection = self._socket
        if not isinstance(connection, _LimitedConnection):
            raise PeerClosed(CLOSED)
        sign = connection.next_sign()
        try:
            await connection.ping()
            await sign
        except ConnectionClosed as ended:
            raise PeerClosed(_end(ended)) from ended

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes."""
        if self._socket is None:
            return 0
        transport = self._socket.transport
        line = transport.get_extra_info("socket")
        return transport.get_write_buffer_size() + self._dialer.unsent(line)

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        connection, self._socket = self._socket, None
        try:
            if connection is not None:
                await self._dialer.reset(connection.transport.get_extra_info("socket"))
                connection.transport.abort()
                with suppress(TimeoutError):
                    async with asyncio.timeout(_CLOSE_S):
                        await connection.wait_closed()
        finally:
            await self._dialer.close()

    async def _connect(self, timeout_s: float) -> ClientConnection:
        place = self._place
        line = await self._dialer.plug(timeout_s)
        try:
            # Our own timeout covers connecting and the handshake.
            return await _Connect(
                f"ws://{place.authority}{place.path}",  # TLS, if any, is in the layer below
                sock=line,
                create_connection=_LimitedConnection,
                subprotocols=self._subprotocols or None,
                additional_headers=self._headers,
                proxy=None,
                compression=None,
                open_timeout=None,
                ping_interval=self._ping_s,
                ping_timeout=self._pong_s,
                close_timeout=_CLOSE_S,
                max_size=self._max_bytes,
                max_queue=READ_AHEAD_MESSAGES,
                write_limit=0,
            )
        except BaseException:
            line.close()
            raise


class _LimitedConnection(ClientConnection):
    """A WebSocket connection with a limit on unsent ping replies.

    The library writes ping replies without checking for buffer space.
    """

    _untaken = 0
    _sign: asyncio.Future[None] | None = None
    is_gathering = False
    """Whether the kernel gathers small messages; see `WebSocketTransport.gather`."""

    def next_sign(self) -> asyncio.Future[None]:
        """Return a future that completes when more data arrives or the connection ends."""
        if self._sign is None or self._sign.done():
            self._sign = asyncio.get_running_loop().create_future()
        return self._sign

    def connection_lost(self, exc: Exception | None) -> None:
        """Wake the tasks that are waiting for more data."""
        self._give_sign()
        super().connection_lost(exc)

    def _give_sign(self) -> None:
        if self._sign is not None and not self._sign.done():
            self._sign.set_result(None)

    def data_received(self, data: bytes) -> None:
        """Process received data; end the connection after too many unsent ping replies."""
        self._give_sign()
        before = self.transport.get_write_buffer_size()
        super().data_received(data)
        if self.is_gathering and len(data) < GATHER_BYTES:
            self._wake_at(_WAKING_BYTES)
            self.loop.call_later(GATHER_S, self._wake_at, 1)
        after = self.transport.get_write_buffer_size()
        self._untaken = self._untaken + after - before if before else after
        if self._untaken > UNTAKEN_BYTES:
            self.set_connection_exc(OSError("the robot does not read the replies to its pings"))
            self.transport.abort()

    def _wake_at(self, size_bytes: int) -> None:
        """Set the number of waiting bytes at which the kernel wakes the event loop."""
        line = self.transport.get_extra_info("socket")
        with suppress(OSError, ValueError):  # the connection has ended; uvloop raises ValueError
            line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVLOWAT, size_bytes)


class _Connect(connect):
    """A WebSocket connector that refuses redirects, because they could lead to another server."""

    def process_redirect(self, exc: Exception) -> Exception | str:
        return exc


def from_setup(setup: TransportSetup) -> Transport:
    """Return a WebSocket transport for a document's options, or raise `TransportError`."""
    return WebSocketTransport(setup)


async def _hang_up(connection: ClientConnection) -> None:
    """Close the connection in an orderly way; after a timeout or a cancellation, reset it."""
    try:
        with suppress(TimeoutError):
            async with asyncio.timeout(2 * _CLOSE_S):
                await connection.close()
    finally:
        connection.transport.abort()
        with suppress(TimeoutError):  # one more turn, and the socket is closed
            async with asyncio.timeout(_CLOSE_S):
                await connection.wait_closed()


def _refusal(fault: Exception, where: str) -> str:
    """Return a one-line message with the reason for a failed handshake."""
    if isinstance(fault, InvalidStatus):
        response = fault.response
        target = response.headers.get("Location")
        if 300 <= response.status_code < 400 and target is not None:
            return f"the robot redirected to {one_line(target)}; redirects are not followed"
        status = one_line(f"{response.status_code} {response.reason_phrase}")
        return f"{where} answered {status} instead of opening a WebSocket"
    if isinstance(fault, NegotiationError):
        return f"{where} requires a feature that URC did not offer ({one_line(str(fault))})"
    if isinstance(fault, InvalidMessage | EOFError | ConnectionError):
        return f"the server on {where} does not speak HTTP, or closed the connection"
    return f"the server on {where} is not a WebSocket server ({one_line(str(fault))})"


def _end(ended: ConnectionClosed) -> str:
    """Return a one-line message that states why the connection ended."""
    theirs, ours, cause = ended.rcvd, ended.sent, ended.__cause__
    if theirs is not None and ended.rcvd_then_sent is not False:
        said = f" ({theirs.code} {one_line(theirs.reason)})" if theirs.code != _NORMAL else ""
        return f"{HUNG_UP}{said}".replace(" )", ")")
    if ours is not None and ours.code == CloseCode.INTERNAL_ERROR and "ping" in ours.reason:
        return "the robot did not reply to a ping"
    if ours is not None and ours.code != _NORMAL:
        return f"the robot sent invalid data ({ours.code} {one_line(ours.reason)})"
    if isinstance(cause, OSError) and cause.args:
        return broke(cause)
    return HUNG_UP
