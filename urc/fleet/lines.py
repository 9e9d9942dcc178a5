"""Lines: connections between two sites over the fleet's network, as asyncio transports.

Layer 4. A line carries bytes in both directions, in order and with flow control, as TCP does. A
lost message ends the line, because a gap in a stream cannot be repaired in time for driving. TLS
above the line proves who the peer is, so the names here are claims.
"""

import asyncio
import logging
import secrets
import struct
from collections.abc import Callable
from typing import Any, Final

from urc.fleet.bus import Arrival, FleetBus, Lane
from urc.fleet.line_flow import Incoming, LineBroken, Outgoing

__all__ = ["LINES_PER_SITE", "LineTransport", "Lines", "SiteAbsent"]

LINES_PER_SITE: Final = 256
"""Maximum number of lines that another site may have open."""
STALL_S: Final = 5.0
"""Time without a confirmation after which a line with unconfirmed bytes ends, in seconds."""
CONFIRM_S: Final = 0.02
"""Longest wait of a confirmation for further bytes, in seconds."""
_HEAD: Final = struct.Struct(">BQQ")
"""Kind of the message, number of the line, and a position or count in bytes."""
_OPEN, _DATA, _CONFIRM, _END = range(4)
_REASON_BYTES: Final = 200
log = logging.getLogger(__name__)

_Key = tuple[str, Lane, int]


class SiteAbsent(Exception):
    """The other site is not present; the message is one line."""


class Lines:
    """All lines of one site."""

    def __init__(self, bus: FleetBus, accept: Callable[[], asyncio.Protocol] | None = None) -> None:
        """Take over the callbacks of `bus`.

        Args:
            bus: the network.
            accept: function that creates the protocol of a line that another site opens; None to
                refuse such lines.
        """
        self._bus = bus
        self._accept = accept
        self._lines: dict[_Key, LineTransport] = {}
        self.on_sites: Callable[[frozenset[str]], None] = _ignore
        """Callback for each change of the present sites."""
        bus.on_arrival = self._arrived
        bus.on_sites = self._sites_changed

    @property
    def sites(self) -> frozenset[str]:
        """Names of the other sites that are present."""
        return self._bus.sites

    @property
    def count(self) -> int:
        """Number of open lines."""
        return len(self._lines)

    def dial(self, site: str, lane: Lane, protocol: asyncio.Protocol) -> "LineTransport":
        """Open a line, and call the protocol's `connection_made`.

        The first bytes may be written immediately. If the other site refuses the line, it ends.

        Raises:
            SiteAbsent: the site is not present.
        """
        if site not in self._bus.sites:
            raise SiteAbsent(f"the site {site} cannot be reached")
        number = secrets.randbits(64)
        line = LineTransport(self._bus, self._lines, (site, lane, number), protocol)
        line.tell(_OPEN, 0)
        line.begin()
        return line

    def close(self) -> None:
        """End all lines."""
        for line in tuple(self._lines.values()):
            line.abort()

    def end_with(self, site: str) -> None:
        """End all lines with a site."""
        for (name, _, _), line in tuple(self._lines.items()):
            if name == site:
                line.abort()

    def _sites_changed(self) -> None:
        here = self._bus.sites
        for name in {key[0] for key in self._lines} - here:
            self.end_with(name)
        self.on_sites(here)

    def _arrived(self, arrival: Arrival) -> None:
        if len(arrival.body) < _HEAD.size:
            return
        kind, number, count = _HEAD.unpack_from(arrival.body)
        key = (arrival.sender, arrival.lane, number)
        line = self._lines.get(key)
        if line is not None:
            line.take(kind, count, arrival.body[_HEAD.size :])
        elif kind == _OPEN:
            self._opened(key)
        elif kind != _END:
            self._bus.send(key[0], key[1], _HEAD.pack(_END, number, 0) + b"the line is not open")

    def _opened(self, key: _Key) -> None:
        site, lane, number = key
        is_full = sum(name == site for name, _, _ in self._lines) >= LINES_PER_SITE
        if self._accept is None or is_full:
            reason = b"too many lines are open" if is_full else b"this site accepts no lines"
            self._bus.send(site, lane, _HEAD.pack(_END, number, 0) + reason)
            return
        LineTransport(self._bus, self._lines, key, self._accept()).begin()


class LineTransport(asyncio.Transport):
    """One end of a line."""

    def __init__(
        self,
        bus: FleetBus,
        lines: dict[_Key, "LineTransport"],
        key: _Key,
        protocol: asyncio.BaseProtocol,
    ) -> None:
        super().__init__()
        self._bus = bus
        self._lines = lines
        self._key = key
        self._protocol = protocol
        self._loop = asyncio.get_running_loop()
        self._out = Outgoing()
        self._in = Incoming()
        self._unread: list[bytes] = []
        self._is_reading = True
        self._is_paused = False
        """Whether the protocol was told to pause writing."""
        self._is_closing = False
        self._is_over = False
        self._confirming: asyncio.TimerHandle | None = None
        self._stall: asyncio.TimerHandle | None = None
        self.reason = ""
        """Why the other site or a fault ended the line; "" before, and for an ordinary end."""

    @property
    def site(self) -> str:
        """Name of the other site, as it claims."""
        return self._key[0]

    # Called by `Lines`

    def begin(self) -> None:
        """Register the line, and pass it to the protocol."""
        self._lines[self._key] = self
        self._protocol.connection_made(self)

    def tell(self, kind: int, count: int, body: bytes = b"") -> bool:
        """Send a message of this line; return False if it is certainly lost."""
        return self._bus.send(
            self._key[0], self._key[1], _HEAD.pack(kind, self._key[2], count) + body
        )

    def take(self, kind: int, count: int, body: bytes) -> None:
        """Process a message of this line."""
        try:
            if kind == _DATA:
                self._in.receive(count, body)
                self._unread.append(body)
                self._read()
            elif kind == _CONFIRM:
                self._out.confirm(count)
                self._watch(is_progress=True)
                self._pump()
            elif kind == _END:
                self._finish(body[:_REASON_BYTES].decode("utf-8", "replace"))
        except LineBroken as fault:
            self._break(str(fault))

    # Called by the protocol

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        """Return ``peername``, the name of the other site and port 0, or ``line``, this line."""
        if name == "line":
            return self
        return (self.site, 0) if name == "peername" else default

    def get_protocol(self) -> asyncio.BaseProtocol:
        """Return the protocol."""
        return self._protocol

    def set_protocol(self, protocol: asyncio.BaseProtocol) -> None:
        """Replace the protocol."""
        self._protocol = protocol

    def is_closing(self) -> bool:
        """Return whether the line is closing or has ended."""
        return self._is_closing or self._is_over

    def write(self, data: bytes | bytearray | memoryview) -> None:
        """Send bytes as far as the window permits, and keep the rest."""
        if not data or self._is_closing or self._is_over:
            return
        self._out.write(data)
        self._pump()

    def set_write_buffer_limits(self, high: int | None = None, low: int | None = None) -> None:
        """Do nothing: the protocol pauses as soon as bytes have to wait, as if `high` were 0."""

    def get_write_buffer_size(self) -> int:
        """Return the number of bytes that wait for the window."""
        return self._out.waiting

    def is_reading(self) -> bool:
        """Return whether received bytes are passed to the protocol."""
        return self._is_reading and not self._is_over

    def pause_reading(self) -> None:
        """Keep received bytes; without confirmations, the sender soon stops."""
        self._is_reading = False

    def resume_reading(self) -> None:
        """Pass on the kept bytes in a later turn of the event loop."""
        if not self._is_reading:
            self._is_reading = True
            self._loop.call_soon(self._read)

    def close(self) -> None:
        """End the line after the bytes that still wait."""
        self._is_closing = True
        if not self._out.waiting and not self._is_over:
            self.tell(_END, 0)
            self._finish("")

    def abort(self) -> None:
        """End the line immediately."""
        self.refuse("the other site ended the line")

    def refuse(self, reason: str) -> None:
        """End the line immediately; the other site learns the reason, in one line."""
        if not self._is_over:
            self.tell(_END, 0, reason.encode()[:_REASON_BYTES])
            self._finish("")

    # Inside

    def _pump(self) -> None:
        while not self._is_over and (part := self._out.take()) is not None:
            if not self.tell(_DATA, *part):
                self._break("the other site cannot be reached")
                return
        self._watch()
        if self._out.waiting and not self._is_paused and not self._is_closing:
            self._is_paused = True
            self._protocol.pause_writing()
        elif not self._out.waiting and self._is_closing:
            self.close()
        elif not self._out.waiting and self._is_paused and not self._is_over:
            self._is_paused = False
            self._protocol.resume_writing()

    def _read(self) -> None:
        while self._unread and self._is_reading and not self._is_over:
            data = self._unread.pop(0)
            self._in.process(len(data))
            if isinstance(self._protocol, asyncio.Protocol):
                self._protocol.data_received(data)
        if self._is_over:
            return
        if self._in.is_due:
            self._confirm()
        elif self._confirming is None:
            self._confirming = self._loop.call_later(CONFIRM_S, self._confirm)

    def _confirm(self) -> None:
        if self._confirming is not None:
            self._confirming.cancel()
            self._confirming = None
        total = self._in.confirmation()
        if total is not None and not self._is_over:
            self.tell(_CONFIRM, total)

    def _watch(self, *, is_progress: bool = False) -> None:
        """Start the time limit for a confirmation, restart it, or stop it."""
        is_waiting = self._out.unconfirmed > 0 and not self._is_over
        if self._stall is not None and (is_progress or not is_waiting):
            self._stall.cancel()
            self._stall = None
        if self._stall is None and is_waiting:
            reason = f"the other site confirmed nothing for {STALL_S:g} s"
            self._stall = self._loop.call_later(STALL_S, self._break, reason)

    def _break(self, reason: str) -> None:
        log.warning("a line to the site %s ended: %s", self.site, reason)
        self.tell(_END, 0, reason.encode()[:_REASON_BYTES])
        self._finish(reason)

    def _finish(self, reason: str) -> None:
        if self._is_over:
            return
        self._is_over = True
        self.reason = reason
        self._lines.pop(self._key, None)
        self._unread.clear()
        for timer in (self._confirming, self._stall):
            if timer is not None:
                timer.cancel()
        fault = ConnectionResetError(reason) if reason else None
        self._loop.call_soon(self._protocol.connection_lost, fault)


def _ignore(sites: frozenset[str]) -> None:
    """Ignore a change; the default callback."""
