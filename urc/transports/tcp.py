"""The TCP transport, which connects or listens (``mode: listen``), with optional TLS."""

import asyncio
import errno
import socket
from collections.abc import Callable
from contextlib import suppress

from urc.transports import _options
from urc.transports._faults import place_of, reason
from urc.transports._lookup import AddressLookup
from urc.transports._stream import READ_AHEAD_BYTES, StreamTransport, TcpStream, adopt, tune
from urc.transports._stream_dialer import StreamDialer
from urc.transports._tls import Tls
from urc.transports.base import (
    ByteStream,
    ConnectFailed,
    SupportsEnd,
    Transport,
    TransportError,
    TransportSetup,
    Tunnel,
)

__all__ = ["READ_AHEAD_BYTES", "TcpListener", "TcpTransport", "from_setup"]


HANDOVER_S = 6.0
"""Time for which a newer connection waits for the next `open`, in seconds. The time is slightly
longer than the backoff between connection attempts."""
_WAITING = 8
_AGAIN_S = 0.1
"""Delay after a failed accept call, in seconds."""

_Caller = tuple[socket.socket, str]
"""A connected socket and the remote address."""


class TcpListener(StreamTransport):
    """A transport that listens for one robot; a newer connection replaces the current connection.

    After a failed `open`, the port keeps listening, so that a robot is not refused between two
    attempts. After a replacement, the first `close` also keeps the port listening. The next `open`
    within `HANDOVER_S` seconds receives the newer connection. Every other call of `close` stops
    listening on the port.
    """

    def __init__(self, bind: str, port: int, *, only: str = "", tls: Tls | None = None) -> None:
        """Initialise without listening.

        Args:
            bind: local address; "" for all addresses of this machine.
            port: local port, 0 to 65535; 0 lets the system choose.
            only: host that may connect; "" for any host.
            tls: TLS settings.
        """
        super().__init__()
        self._bind = bind
        self._port = port
        self._only = only
        self._tls = tls
        self._lookup = AddressLookup(only, 0, socket.SOCK_STREAM) if only else None
        self._listener: socket.socket | None = None
        self._newer: _Caller | None = None
        self._door: asyncio.Task[None] | None = None
        """Task that accepts connections if the event loop cannot watch sockets; otherwise None."""
        self._allowed_now: tuple[frozenset[str] | None] | None = None
        """Addresses that may connect; None while connections are not accepted."""
        self._again: asyncio.TimerHandle | None = None
        self._came = asyncio.Event()
        self._shut: asyncio.TimerHandle | None = None

    @property
    def address(self) -> str:
        """Listening address in readable form, such as ``tcp 0.0.0.0:6789 (listening)``."""
        return f"tcp {self._place} (listening)"

    @property
    def port(self) -> int:
        """Local port number; while not listening, the configured port, which may be 0."""
        return self._port if self._listener is None else int(self._listener.getsockname()[1])

    @property
    def _place(self) -> str:
        return place_of(self._bind or "*", self.port)

    async def open(self, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds for a connection, or raise `ConnectFailed`."""
        await super().close()
        self._stay_open()
        try:
            async with asyncio.timeout(timeout_s):
                allowed = await self._allowed()
                self._listen(allowed)
                self._stream = await self._next()
        except TimeoutError as late:
            message = f"no robot has connected to {self._place} within {timeout_s:g} s"
            raise ConnectFailed(message) from late
        except (OSError, UnicodeError) as fault:
            raise ConnectFailed(f"cannot listen on {self._place} ({reason(fault)})") from fault

    async def close(self) -> None:
        """Close immediately. The method never raises and may be called twice."""
        is_first = self._stream is not None
        await super().close()
        if is_first and self._newer is not None:
            self._shut = asyncio.get_running_loop().call_later(HANDOVER_S, self._stop)
        else:
            await self._shut_down()

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        await super().abort()
        await self._shut_down()

    async def _next(self) -> ByteStream:
        while self._newer is None:
            self._came.clear()
            await self._came.wait()
        (line, place), self._newer = self._newer, None
        try:
            tune(line)
            stream = await adopt(line)
        except BaseException:
            line.close()
            raise
        if self._tls is None:
            return stream
        return await self._tls.secure(stream, "", place)

    async def _allowed(self) -> frozenset[str] | None:
        """Return the addresses that may connect; None for all addresses."""
        if self._lookup is None:
            return None
        try:
            rows = await self._lookup.addresses()
        except (OSError, UnicodeError) as fault:
            raise ConnectFailed(f"no such host {self._only!r}") from fault
        return frozenset(str(address[0]) for _, address in rows)

    def _listen(self, allowed: frozenset[str] | None) -> None:
        if self._listener is None:
            family = socket.AF_INET6 if ":" in self._bind else socket.AF_INET
            listener = socket.socket(family, socket.SOCK_STREAM)
            try:
                listener.setblocking(False)
                listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                listener.bind((self._bind, self._port))
                listener.listen(_WAITING)
            except BaseException:
                listener.close()
                raise
            self._listener = listener
        if self._door is None and self._allowed_now is None:
            self._allowed_now = (allowed,)
            try:
                self._watch()
            except NotImplementedError:  # the default event loop of Windows
                self._door = asyncio.create_task(self._let_in(self._listener))

    def _watch(self) -> None:
        if self._listener is not None:
            asyncio.get_running_loop().add_reader(self._listener, self._knock, self._listener)

    def _knock(self, listener: socket.socket) -> None:
        """Accept a waiting connection that the event loop has reported.

        The event loop's own accept function may lose a new connection when cancelled.
        """
        try:
            line, address = listener.accept()
        except BlockingIOError:
            return
        except OSError:  # no descriptors left, or the caller has gone
            loop = asyncio.get_running_loop()
            loop.remove_reader(listener)
            self._again = loop.call_later(_AGAIN_S, self._watch)
            return
        line.setblocking(False)
        self._meet(line, address)

    async def _let_in(self, listener: socket.socket) -> None:
        """Accept connections if the event loop cannot watch sockets."""
        loop = asyncio.get_running_loop()
        while True:
            try:
                line, address = await loop.sock_accept(listener)
            except OSError as fault:
                if fault.errno in (errno.EBADF, errno.EINVAL):
                    return
                await asyncio.sleep(_AGAIN_S)
                continue
            self._meet(line, address)

    def _meet(self, line: socket.socket, address: tuple[str, int]) -> None:
        """Store the newest connection for the next `open` and end the current connection."""
        allowed = self._allowed_now[0] if self._allowed_now is not None else None
        if allowed is not None and _plain(address[0]) not in allowed:
            line.close()
            return
        if self._newer is not None:
            self._newer[0].close()
        self._newer = line, place_of(_plain(address[0]), address[1])
        self._came.set()
        self._replace()

    def _replace(self) -> None:
        """End the current connection, because a newer connection replaces it."""
        stream = self._stream
        if stream is None or self._newer is None:
            return
        if isinstance(stream, SupportsEnd):
            stream.end(f"another robot has replaced this connection ({self._newer[1]})")

    def _stay_open(self) -> None:
        if self._shut is not None:
            self._shut.cancel()
            self._shut = None

    async def _shut_down(self) -> None:
        door = self._door
        self._stop()
        if door is not None:
            with suppress(asyncio.CancelledError):
                await door

    def _stop(self) -> None:
        self._stay_open()
        if self._door is not None:
            self._door.cancel()
            self._door = None
        if self._newer is not None:
            self._newer[0].close()
            self._newer = None
        if self._again is not None:
            self._again.cancel()
            self._again = None
        self._allowed_now = None
        if self._listener is not None:
            with suppress(NotImplementedError):
                asyncio.get_running_loop().remove_reader(self._listener)
            self._listener.close()
            self._listener = None


def _plain(address: str) -> str:
    """Return an IPv4-mapped IPv6 address in IPv4 notation, without the zone."""
    return address.removeprefix("::ffff:").partition("%")[0]


_LOOPBACK = "127.0.0.1"


class TcpTransport(StreamTransport):
    """A reusable transport over one TCP connection."""

    def __init__(
        self,
        host: str,
        port: int,
        *,
        tunnel: Tunnel | None = None,
        tls: Tls | None = None,
        read_ahead_bytes: int = READ_AHEAD_BYTES,
    ) -> None:
        """Prepare connections to `host` (name or address) and `port` (1 to 65535)."""
        super().__init__()
        self._reach = StreamDialer(
            host, port, tunnel=tunnel, tls=tls, read_ahead_bytes=read_ahead_bytes
        )

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``tcp 192.168.1.5:6789``."""
        return f"tcp {self._reach.place}"

    async def open(self, timeout_s: float) -> None:
        """Open the connection within `timeout_s` seconds, or raise `ConnectFailed`.

        The addresses of a host name are tried in sequence, each with an equal share of the
        remaining time.
        """
        await self.close()
        self._stream = await self._reach.open(timeout_s)

    # -- a `Prompt`

    def offer(self, data: bytes) -> bool:
        """Send `data` unless earlier data is waiting; return whether `data` was accepted."""
        stream = self._stream
        return type(stream) is TcpStream and stream.offer(data)

    @property
    def is_clogged(self) -> bool:
        """Whether accepted data is still unwritten; `send` waits until all data is written."""
        stream = self._stream
        return type(stream) is TcpStream and not stream.is_writable

    def divert(self, sink: Callable[[bytes], bool]) -> None:
        """Pass received data to `sink` instead of `receive`, until the connection is closed."""
        if isinstance(self._stream, TcpStream):
            self._stream.sink = sink


def from_setup(setup: TransportSetup) -> Transport:
    """Return a TCP transport for a document's options.

    ``host`` and ``port`` specify the robot's address. With ``mode: listen``, the robot connects to
    ``bind`` (loopback by default) and ``port``. Only ``host`` may connect, unless the options
    include ``from: any``.

    Raises:
        TransportError: an option is missing or invalid.
    """
    options = setup.options
    mode = _options.choice("tcp", options, "mode", ("connect", "listen"), "connect")
    port = _options.port("tcp", options)
    if mode == "connect":
        if "bind" in options or "from" in options:
            raise TransportError("tcp accepts bind and from only with mode: listen")
        host = _options.host("tcp", options)
        tls = Tls.of("tcp", options.get("tls"))
        return TcpTransport(host, port, tunnel=setup.tunnel, tls=tls)
    if setup.tunnel is not None:
        raise TransportError("tcp cannot listen through a tunnel; remove tunnel or mode")
    bind = _options.text("tcp", options, "bind", _LOOPBACK)
    only = _options.text("tcp", options, "host")
    who = _options.choice("tcp", options, "from", ("any", "host"), "host" if only else "any")
    if who == "host" and not only:
        raise TransportError("tcp with 'from: host' needs the permitted robot's address in host")
    tls = Tls.of("tcp", options.get("tls"), is_server=True)
    return TcpListener(bind, port, only=only if who == "host" else "", tls=tls)
