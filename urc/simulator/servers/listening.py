"""Base classes of simulated servers that listen on a TCP port."""

import asyncio
import socket
from abc import ABC, abstractmethod
from collections.abc import Awaitable, Callable, Coroutine
from contextlib import suppress
from typing import Any, ClassVar, NamedTuple
from urllib.parse import urlsplit

from urc.problems import UrcError
from urc.simulator.servers.base import (
    Endpoint,
    ServerContext,
    cannot_listen,
    host_and_port,
    option_port,
)
from urc.simulator.servers.clients import READ_BYTES, ClientConnection, Clients

__all__ = ["Listener", "ListeningServer", "StreamServer", "UrlServer", "keep_alive"]


class Listener(NamedTuple):
    """A listening socket of asyncio or another library."""

    address: tuple[Any, ...]
    """Host and port, followed by system-specific values."""
    close: Callable[[], None]
    """Function that stops accepting connections."""
    wait_closed: Callable[[], Awaitable[None]]


class ListeningServer(ABC):
    """Base class of servers that listen on a port, with all connected clients."""

    DEFAULT_PORT: ClassVar[int | None] = None
    """Default port of the transport type."""

    def __init__(self, context: ServerContext) -> None:
        self._context = context
        self._clients = Clients(context)
        self._listener: Listener | None = None

    async def open(self) -> Endpoint:
        """Listen on the port in the options, or on any free port."""
        port = self._port()
        try:
            self._listener = await self._listen(self._context.host, port)
        except OSError as fault:
            raise cannot_listen(self._context, port, fault) from fault
        return self._endpoint(*self._listener.address[:2])

    async def close(self) -> None:
        """Stop listening and disconnect every client."""
        if self._listener is not None:
            self._listener.close()
        await self._clients.close()
        if self._listener is not None:
            await self._listener.wait_closed()

    def _port(self) -> int:
        return option_port(self._context, default=self.DEFAULT_PORT)

    @abstractmethod
    async def _listen(self, host: str, port: int) -> Listener:
        """Open the socket; raise OSError if the address is not available."""

    def _endpoint(self, host: str, port: int) -> Endpoint:
        text = f"{self._context.spec.type} {host_and_port(host, port)}"
        return Endpoint(host, port, text, {"host": host, "port": port})


class UrlServer(ListeningServer):
    """A server whose address is in the driver's option `url`."""

    SCHEME: ClassVar[str]
    """URL scheme without TLS."""
    URL_PORT: ClassVar[int] = 80
    """Port of a URL without a port."""
    _path = "/"

    def _port(self) -> int:
        """Return the port of the URL; for 0, the system chooses a port."""
        context = self._context
        url = str(context.options.get("url"))
        try:
            parts = urlsplit(url)
            port = self.URL_PORT if parts.port is None else parts.port
        except ValueError as fault:
            message = f"transports.{context.name}.url: {url!r} is not a URL to listen on"
            raise UrcError(message) from fault
        self._path = parts.path or "/"
        if context.is_anywhere:
            return 0
        if parts.scheme != self.SCHEME:
            message = f"expected the scheme {self.SCHEME}, found {parts.scheme!r}"
            raise UrcError(f"transports.{context.name}.url: {message}")
        return port

    def _endpoint(self, host: str, port: int) -> Endpoint:
        url = f"{self.SCHEME}://{host_and_port(host, port)}{self._path}"
        text = f"{self._context.spec.type} {url}"
        return Endpoint(host, port, text, {"url": url, "tls": None})


class StreamServer(ListeningServer):
    """A server for clients that use plain byte streams."""

    async def _listen(self, host: str, port: int) -> Listener:
        server = await asyncio.start_server(self._accept, host, port, limit=READ_BYTES)
        return Listener(server.sockets[0].getsockname(), server.close, server.wait_closed)

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        keep_alive(writer.get_extra_info("socket"))
        writer.transport.set_write_buffer_limits(high=READ_BYTES)
        self._clients.admit(
            lambda client: self._talk(client, reader, writer), writer.transport.abort
        )

    @abstractmethod
    def _talk(
        self,
        client: ClientConnection,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> Coroutine[Any, Any, None]:
        """Exchange data with one client until the connection ends."""


def keep_alive(connection: socket.socket) -> None:
    """Enable TCP keepalive, so that the system detects clients that vanish silently."""
    with suppress(OSError):  # the connection is closed already
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
