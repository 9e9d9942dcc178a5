"""An emulated robot behind an SSH server.

The server connects the client's shell, or the driver's command, to the emulated robot. Forwarded
connections can reach only other transports of the same robot.
"""

import asyncio
import os
import secrets
from collections.abc import Awaitable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import asyncssh

from urc._folders import data_folder
from urc.model.payload import Payload
from urc.problems import UrcError
from urc.simulator.servers.base import Endpoint, ServerContext, host_and_port
from urc.simulator.servers.clients import (
    MAX_CLIENTS,
    READ_BYTES,
    TAKEN_WITHIN_S,
    ClientConnection,
    converse,
)
from urc.simulator.servers.listening import Listener, ListeningServer
from urc.simulator.servers.terminal import TerminalInput, echo_of

__all__ = ["SshServer"]

LOGIN_WITHIN_S = 10.0
_WINDOW = 65536
_NOT_FOUND = 127
"""Exit status of a shell after an unknown command."""


class SshServer(ListeningServer):
    """An SSH port."""

    DEFAULT_PORT = 22

    def __init__(self, context: ServerContext) -> None:
        super().__init__(context)
        self._connections: dict[asyncssh.SSHServerConnection, None] = {}
        self._lock = _Lock(context)
        self._fingerprint = ""

    async def _listen(self, host: str, port: int) -> Listener:
        is_anywhere = self._context.is_anywhere
        key = asyncssh.generate_private_key("ssh-ed25519") if is_anywhere else _own_key()
        self._fingerprint = key.get_fingerprint("sha256")
        acceptor = await asyncssh.listen(
            host,
            port,
            server_factory=lambda: _SshServer(self._context, self._lock, self._connections),
            server_host_keys=[key],
            process_factory=self._accept,
            encoding=None,
            line_editor=False,
            window=_WINDOW,
            login_timeout=LOGIN_WITHIN_S,
            keepalive_interval=5,
            agent_forwarding=False,
            allow_scp=False,
            gss_host=None,
            config=None,
        )

        async def wait_closed() -> None:
            for connection in list(self._connections):
                connection.abort()
                await connection.wait_closed()
            await acceptor.wait_closed()

        return Listener(acceptor.get_addresses()[0], acceptor.close, wait_closed)

    def _endpoint(self, host: str, port: int) -> Endpoint:
        text = f"ssh {host_and_port(host, port)} (host key {self._fingerprint})"
        options = {"host": host, "port": port, "host_key": self._fingerprint}
        return Endpoint(host, port, text, options | self._lock.options)

    def _accept(self, process: "asyncssh.SSHServerProcess[bytes]") -> None:
        declared = self._context.options.get("command")
        if process.command is not None and process.command != declared:
            name = process.command.split(" ", 1)[0]
            process.stderr.write(f"{name}: command not found\n".encode())
            process.exit(_NOT_FOUND)
            return
        process.stdout.channel.set_write_buffer_limits(high=READ_BYTES)
        self._clients.admit(
            lambda client: _ShellConversation(self._context, process).run(client),
            process.channel.abort,
        )


class _Lock:
    """Checks logins against the credentials in the driver's options."""

    def __init__(self, context: ServerContext) -> None:
        options = context.options
        self.username = str(options.get("username", ""))
        self.options: dict[str, Any] = {}
        """Login options for the driver's transport."""
        self.password = str(options.get("password") or "")
        self._key: asyncssh.SSHKey | None = None
        self._takes_any_key = options.get("agent") is True
        if context.is_anywhere:
            # The emulated robot does not need the real robot's key.
            self.password = secrets.token_urlsafe(16)
            self.options = {"password": self.password, "key": None, "agent": False}
        elif key := str(options.get("key") or ""):
            self._key = _private_key(context, key, str(options.get("passphrase") or "") or None)

    @property
    def is_open(self) -> bool:
        return not (self.password or self._key or self._takes_any_key)

    def fits_password(self, username: str, password: str) -> bool:
        return (
            bool(self.password)
            and username == self.username
            and secrets.compare_digest(password.encode(), self.password.encode())
        )

    def fits_key(self, username: str, key: asyncssh.SSHKey) -> bool:
        if username != self.username:
            return False
        mine = self._key is not None and key.public_data == self._key.public_data
        return mine or self._takes_any_key


class _SshServer(asyncssh.SSHServer):
    """One client's connection."""

    def __init__(
        self,
        context: ServerContext,
        lock: _Lock,
        connections: dict[asyncssh.SSHServerConnection, None],
    ) -> None:
        self._context = context
        self._lock = lock
        self._connections = connections
        self._connection: asyncssh.SSHServerConnection

    def connection_made(self, conn: asyncssh.SSHServerConnection) -> None:
        self._connection = conn
        if len(self._connections) >= MAX_CLIENTS:
            next(iter(self._connections)).abort()
        self._connections[conn] = None

    def connection_lost(self, exc: Exception | None) -> None:
        self._connections.pop(self._connection, None)

    def begin_auth(self, username: str) -> bool:
        return not self._lock.is_open

    def password_auth_supported(self) -> bool:
        return bool(self._lock.password)

    def validate_password(self, username: str, password: str) -> bool:
        return self._lock.fits_password(username, password)

    def public_key_auth_supported(self) -> bool:
        return True

    def validate_public_key(self, username: str, key: asyncssh.SSHKey) -> bool:
        return self._lock.fits_key(username, key)

    def connection_requested(
        self, dest_host: str, dest_port: int, orig_host: str, orig_port: int
    ) -> Awaitable[asyncssh.SSHTCPSession[bytes]] | bool:
        inside = self._context.carried.get((dest_host, dest_port))
        if inside is None:
            raise asyncssh.ChannelOpenError(
                asyncssh.OPEN_CONNECT_FAILED, "the emulated robot has no server at this address"
            )
        return self._connection.forward_connection(inside.host, inside.port)  # type: ignore[return-value]


class _ShellConversation:
    """Exchanges data with one client's shell or command."""

    def __init__(self, context: ServerContext, process: "asyncssh.SSHServerProcess[bytes]") -> None:
        self._context = context
        self._process = process
        self._keys = TerminalInput(context.spec)
        self._is_terminal = process.term_type is not None

    async def run(self, client: ClientConnection) -> None:
        try:
            await converse(self._context, client, self._read, self._write)
            self._process.exit(0)
            async with asyncio.timeout(TAKEN_WITHIN_S):
                await self._process.wait_closed()
        except (asyncssh.Error, BrokenPipeError) as gone:
            raise ConnectionResetError(str(gone)) from gone

    async def _read(self) -> bytes:
        typed = b""
        while not typed:
            try:
                data = await self._process.stdin.read(READ_BYTES)
            except (asyncssh.TerminalSizeChanged, asyncssh.SignalReceived):
                continue
            if not data:
                return b""
            typed = data
            if self._is_terminal:
                self._process.stdout.write(echo_of(data))
                typed = self._keys.read(data)
        return typed

    async def _write(self, said: Sequence[Payload]) -> None:
        for one in said:
            if isinstance(one, bytes):
                self._process.stdout.write(one)
        await self._process.stdout.drain()


def _own_key() -> asyncssh.SSHKey:
    """Return the current user's host key for emulated robots.

    The key is stored, so that clients need to trust it only once.
    """
    file = data_folder() / "simulator_host_key"
    try:
        return asyncssh.read_private_key(file)
    except (OSError, asyncssh.KeyImportError):
        key = asyncssh.generate_private_key("ssh-ed25519")
    with suppress(OSError):  # without a file, the next start creates another key
        file.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        _write(file, key.export_private_key("openssh"))
    return key


def _write(file: Path, content: bytes) -> None:
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(descriptor, "wb") as out:
        out.write(content)


def _private_key(
    context: ServerContext, key: str, passphrase: str | None
) -> asyncssh.SSHKey | None:
    """Return the key in the options; raise `UrcError` if the key cannot be used."""
    try:
        if "-----BEGIN" in key:
            return asyncssh.import_private_key(key.strip() + "\n", passphrase)
        return asyncssh.read_private_key(os.path.expanduser(key), passphrase)
    except (OSError, ValueError) as fault:
        raise UrcError(f"transports.{context.name}.key: cannot be used ({fault})") from fault
