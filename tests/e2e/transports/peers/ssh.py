"""A robot behind an SSH server, as a shell and as a forwarded connection, run by the test."""

import asyncio
import socket
from contextlib import suppress

import asyncssh

from tests.e2e.transports.packets import Loss
from tests.e2e.transports.peers.base import Behaviour, Traits
from urc.transports.base import Transport, TransportSetup
from urc.transports.ssh import from_setup
from urc.transports.telnet import from_setup as telnet_from_setup

__all__ = ["CarriedPeer", "SshPeer"]

HOST_KEY = asyncssh.generate_private_key("ssh-ed25519")
_Reader = asyncssh.SSHReader[bytes]
_Writer = asyncssh.SSHWriter[bytes]


class SshPeer:
    """Listens on a free port of loopback; its shell is the robot."""

    traits = Traits()
    ask = b"Give me the battery %\n"
    answer = b"Give me the battery %\n"

    def __init__(self) -> None:
        self._listener = socket.socket()
        self._behaviour: Behaviour = "echo"
        self._acceptor: asyncssh.SSHAcceptor | None = None
        self._mute: asyncio.Server | None = None
        self._connections: list[asyncssh.SSHServerConnection] = []
        self._loss: Loss | None = None
        self.port = 0

    async def start(self, behaviour: Behaviour) -> Transport:
        """Listen, unless the robot refuses; a mute one never says that it is an SSH server."""
        self._behaviour = behaviour
        self._listener.bind(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._loss = Loss(self.port)
        if behaviour == "refuses":
            self._listener.close()
        elif behaviour == "mute":
            self._mute = await asyncio.start_server(_says_nothing, sock=self._listener)
        else:
            self._acceptor = await asyncssh.listen(
                sock=self._listener,
                server_factory=lambda: _Server(self),
                server_host_keys=[HOST_KEY],
                encoding=None,
                line_editor=False,
                window=65536,
            )
        return self.transport()

    def transport(self) -> Transport:
        """Return a line that leads here."""
        return from_setup(self.setup("shell"))

    def setup(self, mode: str) -> TransportSetup:
        """Return what leads here."""
        pty = {"pty": False} if mode == "shell" else {}
        return TransportSetup(
            "jump",
            {
                "host": "127.0.0.1",
                "port": self.port,
                "username": "robot",
                "host_key": HOST_KEY.get_fingerprint("sha256"),
                "mode": mode,
                **pty,
            },
        )

    async def vanish(self) -> None:
        """Lose every packet."""
        assert self._loss is not None
        await self._loss.begin()

    async def stop(self) -> None:
        """Let packets pass again and close everything."""
        if self._loss is not None:
            await self._loss.end()
        for server in (self._acceptor, self._mute):
            if server is not None:
                server.close()
        for connection in self._connections:
            connection.abort()
            await connection.wait_closed()
        for server in (self._acceptor, self._mute):
            if server is not None:
                await server.wait_closed()
        self._listener.close()

    def met(self, connection: asyncssh.SSHServerConnection) -> None:
        """Take note of a client."""
        self._connections.append(connection)

    async def serve(self, reader: _Reader, writer: _Writer, *_: object) -> None:
        """Behave as told."""
        with suppress(OSError, asyncssh.Error):
            await self._behave(reader, writer)
            writer.close()

    async def _behave(self, reader: _Reader, writer: _Writer) -> None:
        if self._behaviour == "deaf":
            writer.channel.pause_reading()
            await writer.channel.wait_closed()
        while data := await reader.read(65536):
            if self._behaviour == "closes":
                return
            if self._behaviour == "drips":
                for byte in data:
                    writer.write(bytes([byte]))
                    await asyncio.sleep(0.01)
            while self._behaviour == "floods":
                writer.write(self.answer * 1000)
                await writer.drain()
            if self._behaviour == "echo":
                writer.write(data)
            await writer.drain()


class CarriedPeer(SshPeer):
    """Telnet to a robot that only the SSH server reaches."""

    def transport(self) -> Transport:
        """Return a line that leads through the server."""
        way = from_setup(self.setup("forward"))
        return telnet_from_setup(TransportSetup("wire", {"host": "10.0.0.20"}, tunnel=way))


class _Server(asyncssh.SSHServer):
    def __init__(self, peer: SshPeer) -> None:
        self._peer = peer

    def connection_made(self, conn: asyncssh.SSHServerConnection) -> None:
        self._peer.met(conn)

    def begin_auth(self, username: str) -> bool:
        return False

    def session_requested(self) -> object:
        return self._peer.serve

    def connection_requested(
        self, dest_host: str, dest_port: int, orig_host: str, orig_port: int
    ) -> object:
        assert (dest_host, dest_port) == ("10.0.0.20", 23)
        return self._peer.serve


async def _says_nothing(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    await reader.read()
    writer.close()
