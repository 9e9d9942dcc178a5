"""The UDP transport; every payload is one datagram, and every datagram is one frame.

UDP has no connections, so opening sends nothing, and a lost robot is detected only by its silence.
The transport reports the errors that UDP can detect: a closed port on the robot and a missing
route. If the options contain no address, opening waits for the first datagram, and its sender
becomes the robot.

If the receive queue is full, the oldest datagrams are dropped and counted in `dropped`.
"""

import asyncio
import errno
import socket
import sys
from collections import deque
from collections.abc import Callable
from contextlib import suppress

from urc.model.payload import Payload
from urc.transports import _options
from urc.transports._faults import CLOSED, broke, explain, place_of, reason
from urc.transports._lookup import AddressLookup
from urc.transports._stream import as_bytes
from urc.transports.base import ConnectFailed, PeerClosed, Transport, TransportError, TransportSetup

__all__ = ["UdpTransport", "from_setup"]

READ_AHEAD = 512
"""Maximum number of received datagrams in the queue."""
READ_AHEAD_BYTES = 1_048_576
"""Maximum number of bytes in all queued datagrams."""
_AT_ONCE = 64
"""Maximum number of datagrams read in one turn of the event loop."""
_LONGEST = 65_536
_RECVERR = {socket.AF_INET: (socket.IPPROTO_IP, 11), socket.AF_INET6: (socket.IPPROTO_IPV6, 25)}
"""Linux socket option IP_RECVERR, which Python does not define. IP_RECVERR also reports refusals on
unconnected sockets."""
_LOST_HERE = (errno.ENOBUFS, errno.EAGAIN, errno.ENOMEM)
"""Errors that report the loss of a datagram on this machine; UDP permits such losses."""
_NO_WAY = (errno.EHOSTUNREACH, errno.ENETUNREACH, errno.ENETDOWN, errno.EADDRNOTAVAIL)

_Address = tuple[str | int, ...]


class UdpTransport:
    """A transport over one socket, for one robot or for all receivers of a broadcast."""

    def __init__(
        self,
        host: str = "",
        port: int = 0,
        *,
        listen: int = 0,
        bind: str = "",
        accepts_any: bool = False,
        is_broadcast: bool = False,
    ) -> None:
        """Store the addresses, without opening the socket.

        Args:
            host: the robot's name or address; "" to accept the first sender.
            port: the robot's port, 1 to 65535; 0 to use the source port of the robot's datagrams.
            listen: local port; 0 lets the system choose.
            bind: local address; "" for all addresses of this machine.
            accepts_any: whether to accept datagrams from any sender, not only from `host`.
            is_broadcast: whether `host` is a broadcast address.
        """
        self._host = host
        self._port = port
        self._listen = listen
        self._bind = bind
        self._accepts_any = accepts_any or not host
        self._is_broadcast = is_broadcast
        self._lookup = AddressLookup(host, port, socket.SOCK_DGRAM) if host else None
        self._allowed: frozenset[str] = frozenset()
        self._robot: _Address | None = None
        """Destination address; None before the first datagram from an unknown robot."""
        self._line: socket.socket | None = None
        self._endpoint: asyncio.DatagramTransport | None = None
        """Transport that reads `_line` if the event loop cannot watch sockets; otherwise None."""
        self._buffer = memoryview(bytearray(_LONGEST))
        self._arrived: deque[bytes] = deque()
        self._arrived_bytes = 0
        self._ended = CLOSED
        self._changed = asyncio.Event()
        self.dropped = 0
        """Number of datagrams dropped since the transport was created."""

    @property
    def address(self) -> str:
        """Target of the transport: ``udp 192.168.10.1:8889``, or ``udp *:14550 (listening)``."""
        if self._host and self._port:
            return f"udp {place_of(self._host, self._port)}"
        sender = f" for {self._host}" if self._host else ""
        return f"udp {place_of(self._bind or '*', self._listen)} (listening{sender})"

    async def open(self, timeout_s: float) -> None:
        """Bind the local port; return immediately if the robot's address is known.

        If the robot's address is unknown, wait for the first datagram; raise `ConnectFailed` after
        `timeout_s` seconds.
        """
        await self.close()
        try:
            async with asyncio.timeout(timeout_s):
                await self._begin()
                while self._lookup is None and self._robot is None:
                    self._changed.clear()
                    await self._changed.wait()
        except TimeoutError as fault:
            is_known = self._line is not None
            await self.close()
            what = "no datagram has reached" if is_known else "no answer to the address lookup of"
            raise ConnectFailed(f"{what} {self.address} within {timeout_s:g} s") from fault
        except BaseException:
            await self.close()
            raise

    async def receive(self) -> bytes:
        """Return the next datagram; raise `PeerClosed` if the connection has ended."""
        while not self._arrived:
            if self._ended:
                raise PeerClosed(self._ended)
            self._changed.clear()
            await self._changed.wait()
        data = self._arrived.popleft()
        self._arrived_bytes -= len(data)
        return data

    async def send(self, data: Payload) -> None:
        """Send `data` as one datagram; raise `TransportError` on failure."""
        payload = as_bytes(data)
        if self._line is None or self._ended or self._robot is None:
            raise PeerClosed(self._ended or CLOSED)
        try:
            self._line.sendto(payload, self._robot)
        except OSError as fault:
            if fault.errno not in _LOST_HERE:
                self._take_fault(fault, len(payload))

    def offer(self, data: bytes) -> bool:
        """Send `data` without waiting; return whether the data was sent."""
        if self._line is None or self._ended or self._robot is None:
            return False
        try:
            self._line.sendto(data, self._robot)
        except OSError:
            return False  # `send` then handles the error
        return True

    async def close(self) -> None:
        """Close immediately. The method never raises and may be called twice."""
        line, self._line = self._line, None
        endpoint, self._endpoint = self._endpoint, None
        if endpoint is not None:
            endpoint.abort()
            await asyncio.sleep(0)  # the event loop closes the socket in its next turn
        elif line is not None:
            with suppress(NotImplementedError):
                asyncio.get_running_loop().remove_reader(line)
            line.close()
        self._robot = None
        self._arrived.clear()
        self._arrived_bytes = 0
        self._end(CLOSED)

    async def _begin(self) -> None:
        family = socket.AF_INET6 if ":" in self._bind else socket.AF_INET
        if self._lookup is not None:
            try:
                rows = await self._lookup.addresses()
            except (OSError, UnicodeError) as fault:
                raise ConnectFailed(explain(self._host, self._host, fault)) from fault
            # It is unknown which of a name's addresses works, and robots use IPv4.
            family, address = min(rows, key=lambda row: row[0] != socket.AF_INET)
            self._allowed = frozenset(str(one[0]).partition("%")[0] for _, one in rows)
            self._robot = tuple(address) if self._port else None  # type: ignore[arg-type]
        self._line = line = self._bound(family)
        self._ended = ""
        loop = asyncio.get_running_loop()
        try:
            loop.add_reader(line, self._read)
        except NotImplementedError:  # the default event loop of Windows
            self._endpoint, _ = await loop.create_datagram_endpoint(
                lambda: _Endpoint(self._receive, self._record_error), sock=line
            )

    def _bound(self, family: socket.AddressFamily) -> socket.socket:
        bind = self._bind or ("::" if family == socket.AF_INET6 else "0.0.0.0")  # noqa: S104
        line = socket.socket(family, socket.SOCK_DGRAM)
        try:
            line.setblocking(False)
            if self._is_broadcast:
                line.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            if sys.platform == "linux" and not self._is_broadcast:
                line.setsockopt(*_RECVERR[family], 1)
            line.bind((bind, self._listen))
        except OSError as fault:
            line.close()
            place = place_of(bind, self._listen)
            raise ConnectFailed(f"cannot listen on udp {place} ({reason(fault)})") from fault
        return line

    def _read(self) -> None:
        """Read received datagrams when the event loop reports data."""
        line = self._line
        for index in range(_AT_ONCE):
            if line is None:
                return
            try:
                count, sender = line.recvfrom_into(self._buffer)
            except BlockingIOError:
                if not index:
                    _forget_faults(line)  # an error, not a datagram, keeps the event loop busy
                return
            except OSError as fault:
                _forget_faults(line)
                self._record_error(fault)
                return
            self._receive(bytes(self._buffer[:count]), sender)

    def _receive(self, datagram: bytes, sender: _Address) -> None:
        """Add a datagram from the robot to the queue."""
        host = str(sender[0]).partition("%")[0]
        if not datagram or not (self._accepts_any or host in self._allowed):
            return
        if self._robot is None:
            self._robot = sender
        self._arrived.append(datagram)
        self._arrived_bytes += len(datagram)
        while len(self._arrived) > READ_AHEAD or self._arrived_bytes > READ_AHEAD_BYTES:
            self._arrived_bytes -= len(self._arrived.popleft())
            self.dropped += 1
        self._changed.set()

    def _record_error(self, fault: OSError) -> None:
        with suppress(TransportError):
            self._take_fault(fault, 0)

    def _take_fault(self, fault: OSError, length: int) -> None:
        """Raise `fault` as a `TransportError`; end the connection unless a datagram was too long.

        Raises:
            TransportError: always.
        """
        if fault.errno == errno.EMSGSIZE:
            raise TransportError(f"{length} bytes are too many for one datagram") from fault
        place = place_of(self._host, self._port)
        if isinstance(fault, ConnectionRefusedError | ConnectionResetError):
            self._end(f"nothing listens on {place} (port unreachable)")
        elif fault.errno in _NO_WAY:
            self._end(f"no route to {place} from this network ({reason(fault)})")
        else:
            self._end(broke(fault))
        raise PeerClosed(self._ended) from fault

    def _end(self, why: str) -> None:
        if not self._ended:
            self._ended = why
        self._changed.set()


class _Endpoint(asyncio.DatagramProtocol):
    """A protocol that passes datagrams and errors from the event loop to callbacks."""

    def __init__(
        self, heard: Callable[[bytes, _Address], None], note: Callable[[OSError], None]
    ) -> None:
        self._heard = heard
        self._note = note

    def datagram_received(self, data: bytes, addr: _Address) -> None:
        self._heard(data, addr)

    def error_received(self, exc: Exception) -> None:
        if isinstance(exc, OSError):
            self._note(exc)


def from_setup(setup: TransportSetup) -> Transport:
    """Return a UDP transport for a document's options.

    Raises:
        TransportError: an option is missing or invalid.
    """
    options = setup.options
    if setup.tunnel is not None:
        raise TransportError("udp cannot be tunnelled; remove tunnel")
    host = _options.text("udp", options, "host").strip()
    port = _options.port("udp", options) if options.get("port") is not None else 0
    listen = _options.port("udp", options, "listen") if options.get("listen") is not None else 0
    is_broadcast = _options.flag("udp", options, "broadcast", default=False)
    usual = "host" if host and not is_broadcast else "any"
    who = _options.choice("udp", options, "from", ("any", "host"), usual)
    if not host and (port or who == "host" or is_broadcast):
        raise TransportError("udp needs a host name or address in host")
    if not listen and not (host and port):
        raise TransportError("udp needs the robot's host and port, or a local port in listen")
    return UdpTransport(
        host,
        port,
        listen=listen,
        bind=_options.text("udp", options, "bind"),
        accepts_any=who == "any",
        is_broadcast=is_broadcast,
    )


def _forget_faults(line: socket.socket) -> None:
    """Discard errors of earlier datagrams from the Linux error queue."""
    if sys.platform == "linux":
        with suppress(OSError):
            while True:
                line.recvmsg(0, 512, socket.MSG_ERRQUEUE)
