"""SSH to a robot: a shell, a program, or nothing but the way for other transports.

One connection is shared by all that goes through it: the transport's own channel, where its mode
has one, and the connections of the transports that name it in ``via``. The first who needs it opens
it, the last who leaves closes it, and when it dies everybody is told.
"""

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import asyncssh

from urc.model.codec import Payload
from urc.transports._faults import CLOSED, late
from urc.transports.base import (
    ByteStream,
    ConnectFailed,
    PeerClosed,
    Setup,
    TransportError,
    bytes_of,
)
from urc.transports.ssh_channel import Channel
from urc.transports.ssh_connection import Connection, Shared
from urc.transports.ssh_dial import Offer, Target, dial, look_at_key
from urc.transports.ssh_options import Program, read_program, read_target
from urc.transports.topic_socket import Address

__all__ = ["SshTransport", "from_setup"]

_COLUMNS, _ROWS = 240, 24
"""Of the pseudo-terminal: so wide that no shell breaks a robot's line."""


class SshTransport:
    """One SSH server; a `Transport`, and a `Carrier` of others."""

    def __init__(
        self, target: Target, program: Program, outer: "SshTransport | None" = None
    ) -> None:
        """Prepare a line to `target`, through `outer` if there is one. Nothing is opened yet."""
        self.target = target
        self._program = program
        self._outer = outer
        self._shared = Shared(self._dial)
        self._connection: Connection | None = None
        """While open: we are one of its users."""
        self._channel: Channel | None = None

    @property
    def address(self) -> str:
        """Where it leads, for people: ``ssh 192.168.1.5:22``."""
        return f"ssh {self.target.address.text}"

    async def open(self, timeout_s: float) -> None:
        """Log in and start the program, or raise `ConnectFailed` within `timeout_s` seconds."""
        await self.close()
        async with _within(timeout_s, self.target.address.text):
            connection = await self._shared.join(timeout_s)
            try:
                self._channel = await self._start(connection)
            except BaseException:
                await self._shared.leave()
                raise
            self._connection = connection

    async def receive(self) -> bytes:
        """Return the next bytes, at least one; raise `PeerClosed` when no more will come."""
        if self._channel is not None:
            return await self._channel.take()
        if self._connection is None:
            raise PeerClosed(CLOSED)
        return await self._connection.ended()

    async def send(self, data: Payload) -> None:
        """Hand `data` to the kernel, waiting while it is full; raise `PeerClosed` when it broke."""
        if self._connection is None:
            raise PeerClosed(CLOSED)
        if self._channel is None:
            raise PeerClosed("this line only carries others ('mode: forward')")
        await self._channel.put(bytes_of(data))

    async def close(self) -> None:
        """Close at once. Never raises, may be called twice. Others that go through here go on."""
        channel, self._channel = self._channel, None
        connection, self._connection = self._connection, None
        if channel is not None:
            channel.discard()
        if connection is not None:
            await self._shared.leave()

    def unsent(self) -> int:
        """Return the bytes handed over that have not left this machine for good."""
        return 0 if self._channel is None else self._channel.unsent()

    async def abort(self) -> None:
        """Close at once, for all that go through here; what is unsent is never sent."""
        self.break_off()
        await self.close()

    def break_off(self) -> None:
        """End the connection, and the one that it goes through: the robot has not got it all."""
        self._shared.break_off()
        if self._outer is not None:
            self._outer.break_off()

    async def connect(self, host: str, port: int, timeout_s: float) -> ByteStream:
        """Return a connection to `host` and `port` as the server sees them.

        Raises:
            ConnectFailed: within `timeout_s` seconds.
        """
        async with _within(timeout_s, f"{Address(host, port).text} through {self.address}"):
            connection = await self._shared.join(timeout_s)
            try:
                channel = await connection.forwarded(host, port)
            except BaseException:
                await self._shared.leave()
                raise
        return _Carried(channel, self._shared, self.break_off)

    async def look_at_key(self, timeout_s: float) -> Offer:
        """Return the host key that the server shows, without logging in there.

        Raises:
            ConnectFailed: within `timeout_s` seconds.
        """
        async with _within(timeout_s, self.target.address.text):
            if self._outer is None:
                return await look_at_key(self.target, None, timeout_s)
            outer = await self._outer.join(timeout_s)
            try:
                return await look_at_key(self.target, outer, timeout_s)
            finally:
                await self._outer.leave()

    async def join(self, timeout_s: float) -> asyncssh.SSHClientConnection:
        """Return asyncssh's connection for another SSH connection inside; `leave` when done."""
        return (await self._shared.join(timeout_s)).ssh

    async def leave(self) -> None:
        """Give up what `join` returned."""
        await self._shared.leave()

    async def _dial(self, timeout_s: float) -> Connection:
        if self._outer is None:
            return await dial(self.target, None, timeout_s)
        outer = await self._outer.join(timeout_s)
        try:
            connection = await dial(self.target, outer, timeout_s)
        except BaseException:
            await self._outer.leave()
            raise
        connection.when_closed = self._outer.leave
        return connection

    async def _start(self, connection: Connection) -> Channel | None:
        program = self._program
        if program.mode == "forward":
            return None
        has_pty = program.has_pty
        return await connection.program(
            program.command if program.mode == "exec" else None,
            env=dict(program.environment) or None,
            request_pty="force" if has_pty else False,
            term_type="vt100" if has_pty else None,
            term_size=(_COLUMNS, _ROWS) if has_pty else None,
        )


class _Carried:
    """A connection through the server, which keeps the SSH connection open while it lasts."""

    def __init__(self, channel: Channel, shared: Shared, break_off: Callable[[], None]) -> None:
        self._channel = channel
        self._break_off = break_off
        self._shared = shared
        self._is_user = True

    async def take(self) -> bytes:
        return await self._channel.take()

    async def put(self, data: bytes) -> None:
        await self._channel.put(data)

    def unsent(self) -> int:
        return self._channel.unsent()

    async def reset(self) -> None:
        self._break_off()
        await self.abort()

    async def abort(self) -> None:
        self._channel.discard()
        if self._is_user:
            self._is_user = False
            await self._shared.leave()


def from_setup(setup: Setup) -> SshTransport:
    """Make a transport out of a document's options; docs/transports/ssh.md explains each.

    Raises:
        TransportError: an option is missing or not usable.
    """
    if setup.via is not None and not isinstance(setup.via, SshTransport):
        raise TransportError("ssh goes through another ssh only, or through nothing")
    return SshTransport(read_target(setup), read_program(setup), setup.via)


@asynccontextmanager
async def _within(timeout_s: float, place: str) -> AsyncIterator[None]:
    try:
        async with asyncio.timeout(timeout_s):
            yield
    except TimeoutError as fault:
        raise ConnectFailed(late(place, timeout_s)) from fault
