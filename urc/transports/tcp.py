"""TCP to a robot.

Bytes arrive in one fixed buffer a connection: when it is full the socket is not read until somebody
takes it, so a robot that floods fills its own kernel's queue and not our memory. `send` returns
once the kernel has every byte, so a connection may be closed right after the last one.
"""

import asyncio
import errno
import socket
import threading
from collections.abc import Mapping
from contextlib import suppress

from urc.model.values import Value
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportError

__all__ = ["TcpTransport", "from_options"]

READ_AHEAD_BYTES = 65536
"""Most bytes that are read before somebody takes them."""

_KEEPALIVE_IDLE_S, _KEEPALIVE_EVERY_S, _KEEPALIVE_COUNT = 5, 2, 3
_UNANSWERED_MS = 5000
"""A peer that acknowledges nothing for this long is gone (half-open line, pulled cable)."""
_UNSENT_BYTES = 16384
"""How much unsent data the kernel may hold; more would only grow old there."""

_Address = tuple[socket.AddressFamily, tuple[str | int, ...] | tuple[int, bytes]]


class TcpTransport:
    """One TCP connection, opened as often as it is needed."""

    def __init__(self, host: str, port: int, *, read_ahead_bytes: int = READ_AHEAD_BYTES) -> None:
        """Prepare a line to `host` (name or address), `port` 1..65535. Nothing is opened yet."""
        self._host = host
        self._port = port
        self._place = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        self._read_ahead_bytes = read_ahead_bytes
        self._stream: _Stream | None = None
        self._lookup: asyncio.Future[list[_Address]] | None = None

    @property
    def address(self) -> str:
        """Where it leads, for people: ``tcp 192.168.1.5:6789``."""
        return f"tcp {self._place}"

    async def open(self, timeout_s: float) -> None:
        """Connect, or raise `ConnectFailed` within `timeout_s` seconds.

        Every address of a name is tried in turn, each with a fair share of the time that is left.
        """
        await self.close()
        try:
            async with asyncio.timeout(timeout_s):
                self._stream = await self._connect(timeout_s)
        except TimeoutError as late:
            message = f"no answer from {self._place} within {timeout_s:g} s"
            raise ConnectFailed(message) from late
        except (OSError, UnicodeError) as fault:
            raise ConnectFailed(self._explain(fault)) from fault

    async def receive(self) -> bytes:
        """Return the next bytes, at least one; raise `PeerClosed` when no more will come."""
        if self._stream is None:
            raise PeerClosed("the line is closed")
        return await self._stream.take()

    async def send(self, data: bytes) -> None:
        """Hand `data` to the kernel, waiting while it is full; raise `PeerClosed` when it broke."""
        if self._stream is None:
            raise PeerClosed("the line is closed")
        await self._stream.put(data)

    async def close(self) -> None:
        """Close at once, dropping what is unsent. Never raises, may be called twice."""
        stream, self._stream = self._stream, None
        if stream is not None:
            await stream.abort()

    async def _connect(self, timeout_s: float) -> "_Stream":
        loop = asyncio.get_running_loop()
        deadline = loop.time() + timeout_s
        addresses = await self._resolve()
        fault: OSError | None = None
        for place, (family, address) in enumerate(addresses):
            share_s = (deadline - loop.time()) / (len(addresses) - place)
            try:
                async with asyncio.timeout(share_s):
                    return await _dial(family, address, self._read_ahead_bytes)
            except TimeoutError:
                # The last address gets all that is left: then the time of the whole is up as well.
                fault = fault or TimeoutError(errno.ETIMEDOUT, "timed out")
            except OSError as refused:
                fault = refused
        raise fault or OSError("the name leads to no address")

    async def _resolve(self) -> list[_Address]:
        """Look the name up in a thread of our own.

        The loop's pool of threads is waited for when the program ends, and a resolver without a
        network may take half a minute. One look-up at a time: a retry joins the one under way.
        """
        if self._lookup is None or self._lookup.done():
            self._lookup = _look_up(self._host, self._port)
        return await asyncio.shield(self._lookup)

    def _explain(self, fault: OSError | UnicodeError) -> str:
        """Return one line for people about why the line could not be opened."""
        if isinstance(fault, socket.gaierror | UnicodeError):
            return f"no such host {self._host!r}"
        if isinstance(fault, ConnectionRefusedError):
            return f"nothing listens on {self._place} (connection refused)"
        if isinstance(fault, TimeoutError):
            return f"no answer from {self._place}"
        if fault.errno in (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN):
            return f"no way to {self._place} from this network ({_reason(fault)})"
        return f"cannot connect to {self._place} ({_reason(fault)})"


def from_options(options: Mapping[str, Value]) -> Transport:
    """Make a transport out of a document's options ``host`` and ``port``.

    Raises:
        TransportError: an option is missing or not usable.
    """
    host, port = options.get("host"), options.get("port")
    if not isinstance(host, str) or not host.strip():
        raise TransportError(f"tcp needs a host name or address, not {host!r}")
    if isinstance(port, bool) or not isinstance(port, int) or not 1 <= port <= 65535:
        raise TransportError(f"tcp needs a port from 1 to 65535, not {port!r}")
    return TcpTransport(host.strip(), port)


class _Stream(asyncio.BufferedProtocol):
    """One open connection. The stock `asyncio.Protocol` would allocate 256 KiB for every read."""

    def __init__(self, read_ahead_bytes: int) -> None:
        self._buffer = memoryview(bytearray(read_ahead_bytes))
        self._filled = 0
        self._ended: str | None = None
        """Why nothing more will come; None while the line is up."""
        self._arrived = asyncio.Event()
        self._writable = asyncio.Event()
        self._writable.set()
        self._gone = asyncio.Event()
        self._transport: asyncio.Transport

    # -- called by asyncio

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)  # noqa: S101 - asyncio's own promise
        self._transport = transport
        transport.set_write_buffer_limits(high=0)

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._buffer[self._filled :]

    def buffer_updated(self, nbytes: int) -> None:
        self._filled += nbytes
        if self._filled == len(self._buffer):
            self._transport.pause_reading()
        self._arrived.set()

    def eof_received(self) -> bool:
        self._end("the robot closed the line")
        return False

    def connection_lost(self, exc: Exception | None) -> None:
        self._end(f"the line broke ({_reason(exc)})" if exc else "the robot closed the line")
        self._gone.set()

    def pause_writing(self) -> None:
        self._writable.clear()

    def resume_writing(self) -> None:
        self._writable.set()

    # -- called by TcpTransport

    async def take(self) -> bytes:
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
        await self._until_writable()
        self._transport.write(data)
        await self._until_writable()

    async def abort(self) -> None:
        self._end("the line is closed")
        self._transport.abort()
        await self._gone.wait()  # one turn of the loop: then the socket is closed, too

    async def _until_writable(self) -> None:
        await self._writable.wait()
        if self._ended is not None:
            raise PeerClosed(self._ended)

    def _end(self, reason: str) -> None:
        if self._ended is None:
            self._ended = reason
        self._arrived.set()
        self._writable.set()


async def _dial(family: int, address: object, read_ahead_bytes: int) -> _Stream:
    """Connect one socket, which is closed again when that fails or is cancelled."""
    loop = asyncio.get_running_loop()
    line = socket.socket(family, socket.SOCK_STREAM)
    try:
        line.setblocking(False)
        _tune(line)
        await loop.sock_connect(line, address)  # type: ignore[arg-type] # as getaddrinfo gave it
        if line.getsockname() == line.getpeername():
            # A port of this machine that nobody listens on, and the kernel chose it for our end.
            raise ConnectionRefusedError(errno.ECONNREFUSED, "connected to itself")
        _, stream = await loop.create_connection(lambda: _Stream(read_ahead_bytes), sock=line)
    except BaseException:
        line.close()
        raise
    return stream


def _tune(line: socket.socket) -> None:
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


def _look_up(host: str, port: int) -> asyncio.Future[list[_Address]]:
    loop = asyncio.get_running_loop()
    answer: asyncio.Future[list[_Address]] = loop.create_future()
    # Nobody may be waiting any more when the look-up fails: then its error is not news.
    answer.add_done_callback(lambda done: done.cancelled() or done.exception())

    def settle(found: list[_Address] | None, fault: OSError | UnicodeError | None) -> None:
        if not answer.done():
            if fault is not None:
                answer.set_exception(fault)
            else:
                answer.set_result(found or [])

    def work() -> None:
        found: list[_Address] | None = None
        fault: OSError | UnicodeError | None = None
        try:
            rows = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
            found = [(family, address) for family, _, _, _, address in rows]
        except (OSError, UnicodeError) as problem:
            fault = problem
        with suppress(RuntimeError):  # the loop has ended meanwhile
            loop.call_soon_threadsafe(settle, found, fault)

    threading.Thread(target=work, name=f"look up {host}", daemon=True).start()
    return answer


def _reason(fault: BaseException) -> str:
    """Return the system's words for `fault`, in lower case, without the number."""
    text = getattr(fault, "strerror", None) or str(fault) or type(fault).__name__
    return str(text).lower()
