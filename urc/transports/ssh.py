"""The SSH transport: a shell, a program, or only a tunnel for other transports.

An SSH transport shares its connection with all transports that name this transport in ``tunnel``.
The connection opens with the first of these transports, and closes with the last. A lost
connection disconnects all of these transports.
"""

import asyncio
import re
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Final, Literal, NamedTuple, cast

import asyncssh

from urc.model.payload import Payload
from urc.transports import _options
from urc.transports._faults import CLOSED, late
from urc.transports.base import (
    ByteStream,
    ConnectFailed,
    PeerClosed,
    TransportError,
    TransportSetup,
    bytes_of,
)
from urc.transports.known_hosts import DEFAULT_PORT, HostKeys
from urc.transports.ssh_channel import SshChannel
from urc.transports.ssh_connection import SharedConnection, SshConnection
from urc.transports.ssh_dial import OfferedHostKey, SshTarget, dial, look_at_key
from urc.transports.ssh_login import Login
from urc.transports.topic_socket import Address

__all__ = ["RemoteProgram", "SshTransport", "from_setup", "read_program", "read_target"]


Mode = Literal["shell", "exec", "forward"]

_DURATION: Final = re.compile(r"([0-9]+(?:\.[0-9]+)?)(ms|s|m)")
_SECONDS: Final = {"ms": 0.001, "s": 1.0, "m": 60.0}
_FINGERPRINT: Final = re.compile(r"SHA256:[A-Za-z0-9+/]{43}=?")
_NAME: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_ALIVE_S: Final = (0.2, 60.0)


class RemoteProgram(NamedTuple):
    """The remote program that an SSH transport runs."""

    mode: Mode = "shell"
    command: str = ""
    """Command that the mode ``exec`` runs on the server."""
    has_pty: bool = True
    """Whether the program runs on a pseudo-terminal and therefore shows prompts and echoes input.
    """
    environment: tuple[tuple[str, str], ...] = ()


def read_target(setup: TransportSetup) -> SshTarget:
    """Return the server and the login; raise `TransportError` for an invalid option."""
    options = setup.options
    username = _text(options, "username")
    if not username:
        raise TransportError("ssh needs a username")
    pinned, file = _text(options, "host_key"), _text(options, "known_hosts")
    if pinned and not _FINGERPRINT.fullmatch(pinned):
        raise TransportError(
            f"ssh: host_key is a fingerprint as 'ssh-keygen -l' prints it, SHA256:…, not {pinned!r}"
        )
    return SshTarget(
        address=_address(options),
        login=Login(
            username=username,
            password=_text(options, "password"),
            key=_text(options, "key"),
            passphrase=_text(options, "passphrase"),
            agent=_options.flag("ssh", options, "agent", default=False),
            legacy=_options.flag("ssh", options, "legacy", default=False),
        ),
        keys=HostKeys(pinned, file),
        keepalive_s=_keepalive(options.get("keepalive_interval", "2s")),
        name=setup.name,
    )


def read_program(setup: TransportSetup) -> RemoteProgram:
    """Return the remote program; raise `TransportError` for an invalid option."""
    options = setup.options
    mode = _options.choice("ssh", options, "mode", ("shell", "exec", "forward"), "shell")
    command = _options.text("ssh", options, "command")
    if mode == "exec" and not command:
        raise TransportError("ssh: 'mode: exec' needs a command")
    if command and mode != "exec":
        raise TransportError(f"ssh: a command needs 'mode: exec', not 'mode: {mode}'")
    return RemoteProgram(
        mode=cast(Mode, mode),
        command=command,
        has_pty=_options.flag("ssh", options, "pty", default=mode == "shell"),
        environment=_environment(options.get("environment")),
    )


def _address(options: Mapping[str, object]) -> Address:
    options = {"port": DEFAULT_PORT, **options}
    return Address(_options.host("ssh", options), _options.port("ssh", options))


def _text(options: Mapping[str, object], name: str) -> str:
    """Return a text option; error messages omit the value, which may be a secret."""
    value = options.get(name)
    if value is None:
        return ""
    if not isinstance(value, str):
        raise TransportError(f"ssh: {name} must be text; put the value in quotation marks")
    return value


def _keepalive(value: object) -> float:
    found = _DURATION.fullmatch(value) if isinstance(value, str) else None
    seconds = float(found[1]) * _SECONDS[found[2]] if found else 0.0
    if not _ALIVE_S[0] <= seconds <= _ALIVE_S[1]:
        raise TransportError(
            f"ssh: keepalive_interval must be a time from 200ms to 1m, not {value!r}"
        )
    return seconds


def _environment(value: object) -> tuple[tuple[str, str], ...]:
    if value is None:
        return ()
    if not isinstance(value, Mapping):
        raise TransportError("ssh: environment must contain entries of the form NAME: value")
    pairs = []
    for name, text in value.items():
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise TransportError(f"ssh: {name!r} is not the name of an environment variable")
        if not isinstance(text, str):
            raise TransportError(
                f"ssh: environment.{name} must be text; put the value in quotation marks"
            )
        pairs.append((name, text))
    return tuple(pairs)


_COLUMNS, _ROWS = 240, 24
"""Columns and rows of the pseudo-terminal, which is wide enough to keep shells from wrapping long
lines."""


class SshTransport:
    """A transport to one SSH server, and a `Tunnel` for other transports."""

    def __init__(
        self, target: SshTarget, program: RemoteProgram, outer: "SshTransport | None" = None
    ) -> None:
        """Store the server and the program; `outer` is the tunnel's SSH transport, or None."""
        self.target = target
        self._program = program
        self._outer = outer
        self._shared = SharedConnection(self._dial)
        self._connection: SshConnection | None = None
        """The shared connection while this transport is open; otherwise None."""
        self._channel: SshChannel | None = None

    @property
    def address(self) -> str:
        """The transport's target in readable form, such as ``ssh 192.168.1.5:22``."""
        return f"ssh {self.target.address.text}"

    async def open(self, timeout_s: float) -> None:
        """Log in and start the program within `timeout_s` seconds, or raise `ConnectFailed`."""
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
        """Return at least one received byte; raise `PeerClosed` when the stream has ended."""
        if self._channel is not None:
            return await self._channel.read()
        if self._connection is None:
            raise PeerClosed(CLOSED)
        return await self._connection.ended()

    async def send(self, data: Payload) -> None:
        """Wait for buffer space, then pass `data` to the kernel; raise `PeerClosed` on an error."""
        if self._connection is None:
            raise PeerClosed(CLOSED)
        if self._channel is None:
            raise PeerClosed("this connection only tunnels other connections ('mode: forward')")
        await self._channel.write(bytes_of(data))

    async def close(self) -> None:
        """Close the transport immediately, without affecting tunnelled transports.

        The method never raises and may be called twice.
        """
        channel, self._channel = self._channel, None
        connection, self._connection = self._connection, None
        if channel is not None:
            channel.discard()
        if connection is not None:
            await self._shared.leave()

    def unsent(self) -> int:
        """Return the number of unacknowledged bytes."""
        return 0 if self._channel is None else self._channel.unsent()

    async def abort(self) -> None:
        """Close the transport and all tunnelled transports immediately; discard unsent data."""
        self.break_off()
        await self.close()

    def break_off(self) -> None:
        """Reset the connection and its outer tunnel, and discard unsent data."""
        self._shared.break_off()
        if self._outer is not None:
            self._outer.break_off()

    async def connect(self, host: str, port: int, timeout_s: float) -> ByteStream:
        """Return a connection to `host` and `port`, opened by the SSH server.

        Raises:
            ConnectFailed: no connection was possible within `timeout_s` seconds.
        """
        async with _within(timeout_s, f"{Address(host, port).text} through {self.address}"):
            connection = await self._shared.join(timeout_s)
            try:
                channel = await connection.forwarded(host, port)
            except BaseException:
                await self._shared.leave()
                raise
        return _Carried(channel, self._shared, self.break_off)

    async def look_at_key(self, timeout_s: float) -> OfferedHostKey:
        """Return the server's host key, without logging in.

        Raises:
            ConnectFailed: no connection was possible within `timeout_s` seconds.
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
        """Return the asyncssh connection for a tunnelled connection; call `leave` afterwards."""
        return (await self._shared.join(timeout_s)).ssh

    async def leave(self) -> None:
        """Release a connection that `join` returned."""
        await self._shared.leave()

    async def _dial(self, timeout_s: float) -> SshConnection:
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

    async def _start(self, connection: SshConnection) -> SshChannel | None:
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
    """A forwarded connection, which keeps its SSH connection open."""

    def __init__(
        self, channel: SshChannel, shared: SharedConnection, break_off: Callable[[], None]
    ) -> None:
        self._channel = channel
        self._break_off = break_off
        self._shared = shared
        self._is_user = True

    async def read(self) -> bytes:
        return await self._channel.read()

    async def write(self, data: bytes) -> None:
        await self._channel.write(data)

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


def from_setup(setup: TransportSetup) -> SshTransport:
    """Return an SSH transport for a document's options; see docs/transports/ssh.md.

    Raises:
        TransportError: an option is missing or invalid.
    """
    if setup.tunnel is not None and not isinstance(setup.tunnel, SshTransport):
        raise TransportError("ssh can be tunnelled only through another ssh transport")
    return SshTransport(read_target(setup), read_program(setup), setup.tunnel)


@asynccontextmanager
async def _within(timeout_s: float, place: str) -> AsyncIterator[None]:
    try:
        async with asyncio.timeout(timeout_s):
            yield
    except TimeoutError as fault:
        raise ConnectFailed(late(place, timeout_s)) from fault
