"""An emulated robot behind a pseudo-terminal, which programs can open like a serial port.

The system chooses the name of the pseudo-terminal. If the profile's port is a nonexistent path
outside ``/dev``, the server creates a symbolic link at that path. The profile then works without
changes. For ``socket://HOST:PORT``, the server listens on a TCP port.
"""

import asyncio
import errno
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

from urc.model.payload import Payload
from urc.problems import UrcError
from urc.simulator.servers.base import Endpoint, ServerContext, SimulatedServer, reason
from urc.simulator.servers.clients import READ_BYTES, ClientConnection, Clients, converse
from urc.simulator.servers.tcp import TcpServer

__all__ = ["SerialServer"]

_LOOK_S = 0.02
"""Interval at which the server checks whether a program has opened the pseudo-terminal, in seconds.
The system does not report when a program opens the pseudo-terminal."""


class SerialServer:
    """One serial port with at most one client."""

    def __init__(self, context: ServerContext) -> None:
        port = str(context.options.get("port") or "")
        is_address = "://" in port and not (context.is_anywhere and port.startswith("rfc2217:"))
        self._server: SimulatedServer = (
            _SocketServer(context, port) if is_address else _PtyServer(context, port)
        )

    async def open(self) -> Endpoint:
        """Create the port."""
        return await self._server.open()

    async def close(self) -> None:
        """Remove the port."""
        await self._server.close()


class _PtyServer:
    def __init__(self, context: ServerContext, port: str) -> None:
        self._context = context
        self._port = port
        self._clients = Clients(context, limit=1)
        self._wire = -1
        self._link: Path | None = None
        self._watch: asyncio.Task[None] | None = None

    async def open(self) -> Endpoint:
        if sys.platform == "win32":
            raise UrcError(f"transports.{self._context.name}: this system has no pseudo-terminals")
        import pty
        import tty

        self._wire, client = pty.openpty()
        tty.setraw(client)
        path = os.ttyname(client)
        os.close(client)  # from now on reading fails until a program opens the port
        os.set_blocking(self._wire, False)
        text = f"serial {path}"
        if self._needs_link():
            self._link = Path(self._port)
            try:
                self._link.symlink_to(path)
            except OSError as fault:
                message = f"cannot create {self._port} ({reason(fault)})"
                await self.close()
                raise UrcError(f"transports.{self._context.name}: {message}") from fault
            text += f", as {self._port}"
        self._watch = asyncio.create_task(self._await_clients())
        return Endpoint("", 0, text, {"port": path}, path)

    async def close(self) -> None:
        if self._watch is not None:
            self._watch.cancel()
            await asyncio.gather(self._watch, return_exceptions=True)
        await self._clients.close()
        if self._link is not None:
            with suppress(OSError):
                self._link.unlink()
        if self._wire >= 0:
            os.close(self._wire)
            self._wire = -1

    def _needs_link(self) -> bool:
        path = Path(self._port)
        return (
            not self._context.is_anywhere
            and path.is_absolute()
            and not path.is_relative_to("/dev")
            and not path.exists()
        )

    async def _await_clients(self) -> None:
        """Serve the programs that open the port, one after another."""
        while True:
            first = self._read()
            if first is None:
                await asyncio.sleep(_LOOK_S)
                continue
            gone = asyncio.Event()
            wire = _TerminalEnd(self._wire, first)
            self._clients.admit(lambda client, wire=wire: self._talk(client, wire), gone.set)  # type: ignore[misc] # of this turn
            await gone.wait()

    def _read(self) -> bytes | None:
        """Return the received bytes; None while no program has the port open."""
        try:
            return os.read(self._wire, READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError:
            return None

    async def _talk(self, client: ClientConnection, wire: "_TerminalEnd") -> None:
        await converse(self._context, client, wire.read, wire.write)


class _TerminalEnd:
    """The robot's end of a pseudo-terminal while a client is connected."""

    def __init__(self, number: int, first: bytes) -> None:
        self._number = number
        self._first = first

    async def read(self) -> bytes | None:
        """Return the next bytes; None after the client has closed the port."""
        if self._first:
            data, self._first = self._first, b""
            return data
        while True:
            try:
                return os.read(self._number, READ_BYTES)
            except BlockingIOError:
                await self._until_ready()
            except OSError as fault:
                if fault.errno == errno.EIO:
                    return None
                raise

    async def write(self, said: Sequence[Payload]) -> None:
        """Write the robot's data; wait while the client does not read."""
        data = b"".join(one for one in said if isinstance(one, bytes))
        while data:
            try:
                data = data[os.write(self._number, data) :]
            except BlockingIOError:
                await self._until_ready(is_write=True)

    async def _until_ready(self, *, is_write: bool = False) -> None:
        loop = asyncio.get_running_loop()
        ready = asyncio.Event()
        if is_write:
            loop.add_writer(self._number, ready.set)
        else:
            loop.add_reader(self._number, ready.set)
        try:
            await ready.wait()
        finally:
            if is_write:
                loop.remove_writer(self._number)
            else:
                loop.remove_reader(self._number)


class _SocketServer(TcpServer):
    """A serial port behind ``socket://HOST:PORT``."""

    def __init__(self, context: ServerContext, port: str) -> None:
        scheme, _, rest = port.partition("://")
        number = rest.rpartition(":")[2]
        if scheme != "socket" or not (number.isascii() and number.isdecimal()):
            raise UrcError(
                f"transports.{context.name}.port: expected a path or socket://HOST:PORT,"
                f" found {port!r}"
            )
        super().__init__(context._replace(options={**context.options, "port": int(number)}))

    async def open(self) -> Endpoint:
        found = await super().open()
        address = f"socket://{found.text.partition(' ')[2]}"
        return found._replace(text=f"serial {address}", options={"port": address})
