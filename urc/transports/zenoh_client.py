"""A transport for devices with Zenoh keys, behind a Zenoh router.

Theory of operation. The library zenoh implements the protocol, but URC opens the network
connection, as for MQTT. Each `open` connects a socket and creates a session of the library for this
connection only. `ZenohRelay` connects the two. The library can therefore neither reconnect nor
queue motion without URC's knowledge, and TLS and tunnels are the same as for other transports.

A router that was restarted knows no subscribers until the robots have connected again. Neither a
new connection nor its stop waits for them, because a subscriber may never appear. Instead, the
guard repeats the stop for some seconds (`urc.motion.hold_to_run.LATE_STOP_S`).

URC is a client of the router. It opens no port and sends no multicast.
"""

import asyncio

from urc.model.payload import Envelope, Payload
from urc.transports._faults import CLOSED, late
from urc.transports._stream_dialer import StreamDialer
from urc.transports.base import ConnectFailed, PeerClosed, TransportError
from urc.transports.zenoh_options import ZenohOptions
from urc.transports.zenoh_session import ZenohSession

__all__ = ["ZenohTransport"]


class ZenohTransport:
    """A transport to one router, which may be opened several times."""

    def __init__(self, options: ZenohOptions, dialer: StreamDialer) -> None:
        """Store the options and the dialer for a router, without connecting."""
        self._options = options
        self._dialer = dialer
        self._session: ZenohSession | None = None

    @property
    def address(self) -> str:
        """The transport's target as display text, such as ``zenoh 192.168.1.5:7447``."""
        return f"zenoh {self._options.where}"

    async def open(self, timeout_s: float) -> None:
        """Connect and subscribe, or raise `ConnectFailed` within `timeout_s` seconds."""
        await self.close()
        try:
            async with asyncio.timeout(timeout_s):
                stream = await self._dialer.open(timeout_s)
                session = ZenohSession(self._options, stream)
                try:
                    await session.start(timeout_s)
                except BaseException:
                    await session.abort()
                    raise
        except TimeoutError as fault:
            raise ConnectFailed(late(self._options.where, timeout_s)) from fault
        self._session = session

    async def receive(self) -> Envelope:
        """Return the next message or response; raise `PeerClosed` when the connection has ended."""
        return await self._open_session().queue.pop()

    async def send(self, data: Payload) -> None:
        """Put or get a value; return after the kernel has accepted the message.

        Raises:
            PeerClosed: the connection broke.
            TransportError: Zenoh cannot send `data`.
        """
        session = self._open_session()
        if not isinstance(data, Envelope):
            raise TransportError("zenoh carries messages, not bytes; use publish or get")
        if data.verb == "publish":
            await session.publish(data)
        elif data.verb == "get":
            await session.get(data)
        else:
            raise TransportError(f"zenoh cannot {data.verb}; supported: publish, get")

    async def close(self) -> None:
        """Close the connection immediately. The method never raises and may be called twice."""
        session, self._session = self._session, None
        if session is not None:
            await session.close()

    async def abort(self) -> None:
        """Close the connection immediately and discard unsent data. Never raises."""
        session, self._session = self._session, None
        if session is not None:
            await session.abort()

    async def probe(self) -> None:
        """Probe the router; return as soon as the router has replied."""
        await self._open_session().ping()

    def arrivals(self) -> int:
        """Return the number of values that have arrived over this connection."""
        return 0 if self._session is None else self._session.queue.arrivals

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes."""
        return 0 if self._session is None else self._session.unsent()

    def _open_session(self) -> ZenohSession:
        if self._session is None:
            raise PeerClosed(CLOSED)
        return self._session
