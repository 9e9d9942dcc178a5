"""An emulated robot that is a TCP server, or a TCP client of the driver (``mode: listen``)."""

import asyncio
import socket
from collections.abc import Sequence
from contextlib import suppress

from urc.model.payload import Payload
from urc.simulator.servers.base import Endpoint, ServerContext, host_and_port
from urc.simulator.servers.clients import READ_BYTES, TAKEN_WITHIN_S, ClientConnection, converse
from urc.simulator.servers.listening import StreamServer

__all__ = ["TcpServer"]

CALLS_EVERY_S = 0.5
"""Delay between attempts to connect to the driver, in seconds."""


class TcpServer(StreamServer):
    """A simulated server on a plain TCP port, or a client of a listening driver."""

    def __init__(self, context: ServerContext) -> None:
        super().__init__(context)
        self._calls: asyncio.Task[None] | None = None

    async def open(self) -> Endpoint:
        """Listen on the configured port or on any free port, or connect to a listening driver."""
        if self._context.options.get("mode") == "listen":
            return self._call(self._port())
        return await super().open()

    async def close(self) -> None:
        """Stop connecting and listening, and close every connection."""
        if self._calls is not None:
            self._calls.cancel()
            await asyncio.gather(self._calls, return_exceptions=True)
        await super().close()

    async def _talk(
        self,
        client: ClientConnection,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
    ) -> None:
        async def put(said: Sequence[Payload]) -> None:
            writer.write(b"".join(one for one in said if isinstance(one, bytes)))
            await writer.drain()

        await converse(self._context, client, lambda: reader.read(READ_BYTES), put)
        writer.close()
        async with asyncio.timeout(TAKEN_WITHIN_S):
            await writer.wait_closed()

    def _call(self, port: int) -> Endpoint:
        context = self._context
        bind = str(context.options.get("bind") or "127.0.0.1")
        host = "127.0.0.1" if context.is_anywhere or bind == "0.0.0.0" else bind  # noqa: S104
        port = port or _free_port(host)
        self._calls = asyncio.create_task(self._keep_calling(host, port))
        text = f"{context.spec.type}, calls {host_and_port(host, port)}"
        return Endpoint(host, port, text, {"bind": host, "port": port, "host": host})

    async def _keep_calling(self, host: str, port: int) -> None:
        """Connect to the driver repeatedly, one connection at a time, like a real robot."""
        while True:
            with suppress(OSError, TimeoutError):
                async with asyncio.timeout(TAKEN_WITHIN_S):
                    reader, writer = await asyncio.open_connection(host, port, limit=READ_BYTES)
                self._accept(reader, writer)
                with suppress(OSError):
                    await writer.wait_closed()
            await asyncio.sleep(CALLS_EVERY_S)


def _free_port(host: str) -> int:
    with socket.socket() as probe:
        probe.bind((host, 0))
        return int(probe.getsockname()[1])
