"""One SSH connection, which several transports can share."""

import asyncio
import ipaddress
import socket
from collections.abc import Awaitable, Callable
from contextlib import suppress
from typing import Any, NoReturn

import asyncssh

from urc._addresses import is_of_this_machine
from urc.transports._faults import CLOSED, HUNG_UP, explain, one_line
from urc.transports._lookup import AddressLookup
from urc.transports.base import ConnectFailed, PeerClosed
from urc.transports.own_listeners import OWN_DOORS, OwnAddressError
from urc.transports.ssh_channel import MAX_PACKET, WINDOW, SshChannel
from urc.transports.ssh_wire import SshSocket
from urc.transports.topic_socket import Address

__all__ = ["SshConnection", "SharedConnection"]

_GONE_WITHIN_S = 0.5
"""Maximum time to wait for a connection to close, in seconds."""
_LOOK_UP_S = 2.0


class SshConnection:
    """An open SSH connection after login."""

    def __init__(
        self, ssh: asyncssh.SSHClientConnection, wire: SshSocket, address: Address
    ) -> None:
        """Store an open SSH connection and its socket."""
        self.ssh = ssh
        self._wire = wire
        self._address = address
        self._strays: set[asyncio.Task[Any]] = set()
        self.when_closed: Callable[[], Awaitable[None]] | None = None
        """Callback that releases the outer tunnel after `close`; called once."""

    @property
    def is_up(self) -> bool:
        """Whether new channels can be opened."""
        return not self._wire.fault and not self.ssh.is_closed()

    @property
    def fault(self) -> str:
        """Why the connection ended; "" while the connection is open."""
        return self._wire.fault

    async def ended(self) -> NoReturn:
        """Wait until the connection has ended, then raise `PeerClosed`."""
        await self.ssh.wait_closed()
        raise PeerClosed(self._wire.fault or HUNG_UP)

    async def program(self, command: str | None, **options: Any) -> SshChannel:
        """Start `command` (None starts a shell); return a channel to the program."""
        what = "the shell" if command is None else "the command"
        return await self._opened(
            lambda channel: self.ssh.create_session(
                lambda: channel, command, encoding=None, window=WINDOW, max_pktsize=MAX_PACKET,
                **options,
            ),
            SshChannel(self._wire, what),
            f"{self._address.text} could not start {what}",
        )  # fmt: skip

    async def forwarded(self, host: str, port: int) -> SshChannel:
        """Return a channel to `host` and `port`, opened by the SSH server."""
        place = Address(host, port).text
        try:
            host = await self._checked(host, port)
        except OwnAddressError as fault:
            raise ConnectFailed(explain(host, place, fault)) from fault
        return await self._opened(
            lambda channel: self.ssh.create_connection(
                lambda: channel, host, port, encoding=None, window=WINDOW, max_pktsize=MAX_PACKET
            ),
            SshChannel(self._wire),
            f"cannot connect to {place} through ssh {self._address.text}",
        )

    async def _checked(self, host: str, port: int) -> str:
        """Return the target address for `host`; raise `OwnAddressError` for URC's own dashboard.

        An SSH server on this machine could reach the dashboard at a loopback address. For such a
        server, this method looks up a host name and returns an address, so that the server cannot
        resolve the name differently.
        """
        is_near = self._is_on_this_machine()
        addresses = [host]
        if is_near:
            try:
                async with asyncio.timeout(_LOOK_UP_S):
                    found = await AddressLookup(host, port, socket.SOCK_STREAM).addresses()
            except (OSError, UnicodeError) as fault:
                raise ConnectFailed(explain(host, Address(host, port).text, fault)) from fault
            addresses = [str(address[0]) for _, address in found]
        for one in addresses:
            with suppress(ValueError):  # a name, which the far end looks up
                address = ipaddress.ip_address(one.partition("%")[0])
                OWN_DOORS.check_place(address, port, is_near=is_near)
        return addresses[0]

    def _is_on_this_machine(self) -> bool:
        """Return whether the server is running on this machine, judging by its address."""
        peer = self.ssh.get_extra_info("peername")
        place = str(peer[0]) if isinstance(peer, tuple) and peer else self._address.host
        try:
            return is_of_this_machine(ipaddress.ip_address(place.partition("%")[0]))
        except ValueError:
            return False

    async def close(self) -> None:
        """Close the connection and all its channels immediately."""
        self._wire.end(CLOSED)
        self.ssh.abort()
        with suppress(TimeoutError):
            async with asyncio.timeout(_GONE_WITHIN_S):
                await self.ssh.wait_closed()
                await self._wire.gone()
                if self._strays:
                    await asyncio.wait(self._strays)
        when_closed, self.when_closed = self.when_closed, None
        if when_closed is not None:
            await when_closed()

    def reset(self) -> None:
        """Reset the connection without a close message, which would also flush unsent data."""
        self._wire.reset()

    async def _opened(
        self, begin: Callable[[SshChannel], Awaitable[Any]], channel: SshChannel, failure: str
    ) -> SshChannel:
        """Open `channel`; after a cancellation, close the channel as soon as possible.

        If the opening of a channel is cancelled, asyncssh forgets the channel, but the server keeps
        it open.
        """
        task = asyncio.ensure_future(begin(channel))
        try:
            await asyncio.shield(task)
        except asyncssh.ChannelOpenError as refused:
            why = self._wire.fault or one_line(refused.reason.lower()).removeprefix(
                "connect failed: "
            )
            raise ConnectFailed(f"{failure} ({why or 'no reason was given'})") from refused
        except (asyncssh.Error, OSError) as fault:
            raise ConnectFailed(
                f"{failure} ({self._wire.fault or one_line(str(fault).lower())})"
            ) from fault
        except asyncio.CancelledError:
            self._strays.add(task)
            task.add_done_callback(lambda done: self._drop(done, channel))
            raise
        return channel

    def _drop(self, task: "asyncio.Task[Any]", channel: SshChannel) -> None:
        self._strays.discard(task)
        if not task.cancelled() and task.exception() is None:
            channel.discard()


class SharedConnection:
    """An SSH connection for several transports, from the first `join` to the last `leave`."""

    def __init__(self, dial: Callable[[float], Awaitable[SshConnection]]) -> None:
        """Initialise without connecting.

        Args:
            dial: function that opens a connection within the given number of seconds and, if
                cancelled, frees all resources.
        """
        self._dial = dial
        self._users = 0
        self._attempt: asyncio.Task[SshConnection] | None = None
        """Task that opens the connection; its result is the connection."""

    async def join(self, timeout_s: float) -> SshConnection:
        """Return the shared connection, opening it if necessary; call `leave` afterwards.

        The caller enforces the timeout; a cancelled caller does not affect other callers.

        Raises:
            ConnectFailed: opening failed. If opening fails, do not call `leave`.
        """
        self._users += 1
        try:
            if self._attempt is None or not self._is_good(self._attempt):
                self._attempt = asyncio.ensure_future(self._again(self._attempt, timeout_s))
            return await asyncio.shield(self._attempt)
        except BaseException:
            await self.leave()
            raise

    async def leave(self) -> None:
        """Release the shared connection; close the connection if no other caller uses it."""
        self._users -= 1
        if self._users:
            return
        attempt, self._attempt = self._attempt, None
        if attempt is None:
            return
        attempt.cancel()  # no effect on a completed attempt
        await asyncio.wait([attempt])
        if not attempt.cancelled() and attempt.exception() is None:
            await attempt.result().close()

    def break_off(self) -> None:
        """Reset the connection for all transports and discard unsent data."""
        if self._attempt is not None and self._attempt.done() and self._is_good(self._attempt):
            self._attempt.result().reset()

    async def _again(
        self, before: "asyncio.Task[SshConnection] | None", timeout_s: float
    ) -> SshConnection:
        """Close the old connection, if it is dead, and open a new connection."""
        if before is not None and not before.cancelled() and before.exception() is None:
            await before.result().close()
        return await self._dial(timeout_s)

    @staticmethod
    def _is_good(attempt: "asyncio.Task[SshConnection]") -> bool:
        if not attempt.done():
            return True
        failed = attempt.cancelled() or attempt.exception() is not None
        return not failed and attempt.result().is_up
