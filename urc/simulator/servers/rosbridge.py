"""The emulated robot behind a rosbridge server: version 2 of the protocol, over WebSocket."""

import asyncio
from collections.abc import Sequence

from websockets.asyncio.server import Server, ServerConnection, broadcast, serve
from websockets.exceptions import ConnectionClosed

from urc.model.codec import Envelope, Payload
from urc.simulator.servers.base import ServerContext
from urc.simulator.servers.clients import ClientConnection, converse
from urc.simulator.servers.rosbridge_protocol import Bridge, BridgeClient
from urc.simulator.servers.websocket import MessageServer
from urc.transports.rosbridge_types import spelled

__all__ = ["RosbridgeServer"]

MAX_BYTES = 10_000_000
"""Largest frame; the default of the real server."""
MAX_UNSENT_BYTES = 4_194_304
"""A client with more unsent bytes than this misses messages."""


class RosbridgeServer(MessageServer):
    """A rosbridge port, and the bridge that its clients share."""

    DEFAULT_PORT = 9090

    def __init__(self, context: ServerContext) -> None:
        """Prepare the server; `open` listens."""
        super().__init__(context)
        # A bridge spells types as its ROS does. A document without a version means ROS 2.
        ros = {1: 1, 2: 2, "auto": 2}.get(context.options.get("ros"))
        types = {name: str(how.get("type") or "") for name, how in context.topics.items()}
        self._bridge = Bridge({name: spelled(kind, "msg", ros) for name, kind in types.items()})

    async def _serve(self, host: str, port: int) -> Server:
        return await serve(
            self._accept,
            host,
            port,
            compression=None,
            max_size=MAX_BYTES,
            max_queue=16,
            ping_interval=None,  # off by default in the real server too
        )

    async def _talk(self, client: ClientConnection, socket: ServerConnection) -> None:
        clock = asyncio.get_running_loop().time

        def send(frame: str | bytes) -> None:
            # Neither waits: a message to one client must not delay the others.
            if socket.transport.get_write_buffer_size() <= MAX_UNSENT_BYTES:
                broadcast([socket], frame)

        member = BridgeClient(self._bridge, send)
        asked: list[tuple[Envelope, int]] = []

        async def take() -> Payload | None:
            if asked:  # answered by now, or never
                envelope, faults = asked.pop()
                if client.line.faults > faults:
                    member.refuses(envelope)
            try:
                while True:
                    heard = member.hears(await socket.recv(), clock())
                    await socket.drain()
                    if heard is not None:
                        asked[:] = [(heard, client.line.faults)]
                        return heard
            except ConnectionClosed:
                return None

        async def put(said: Sequence[Payload]) -> None:
            for payload in said:
                member.says(payload, clock())
            await socket.drain()

        try:
            await converse(self._context, client, take, put)
            await socket.close()
        finally:
            member.leave()
