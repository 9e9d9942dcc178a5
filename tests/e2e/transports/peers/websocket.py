"""A robot on WebSocket, run by the test."""

import asyncio
from contextlib import suppress

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from tests.e2e.transports.peers.base import Behaviour, Traits
from tests.e2e.transports.peers.tcp import TcpPeer
from urc.transports.base import Transport, TransportSetup
from urc.transports.websocket import from_setup

__all__ = ["WebSocketPeer"]


class WebSocketPeer(TcpPeer):
    """Listens on a free port of loopback; each message is a payload."""

    traits = Traits(is_stream=False)
    ask = b"Give me the battery %"
    answer = b"Give me the battery %"

    def __init__(self) -> None:
        super().__init__()
        self._sockets: Server | None = None
        self._behaviour: Behaviour = "echo"
        self._connections: set[ServerConnection] = set()

    async def start(self, behaviour: Behaviour) -> Transport:
        """Listen as the robot on TCP does, and shake hands where that one would talk."""
        if behaviour in ("refuses", "mute"):
            return await super().start(behaviour)
        self._behaviour = behaviour
        self._listener.bind(("127.0.0.1", 0))
        self._begin(self._listener.getsockname()[1])
        self._sockets = await serve(self._meet, sock=self._listener, ping_interval=None)
        return self.transport()

    def transport(self) -> Transport:
        """Return a line that leads here."""
        url = f"ws://127.0.0.1:{self.port}/robot"
        return from_setup(
            TransportSetup("wire", {"url": url, "ping_interval": "1s", "ping_timeout": "2s"})
        )

    async def stop(self) -> None:
        """Let packets pass again and close everything."""
        if self._loss is not None:
            await self._loss.end()
        for connection in self._connections:
            connection.transport.abort()
        if self._sockets is not None:
            self._sockets.close(close_connections=False)
            await self._sockets.wait_closed()
        await super().stop()

    async def _meet(self, connection: ServerConnection) -> None:
        self._connections.add(connection)
        try:
            with suppress(ConnectionClosed):
                await self._behave(connection)
        finally:
            self._connections.discard(connection)

    async def _behave(self, connection: ServerConnection) -> None:
        if self._behaviour == "deaf":
            connection.transport.pause_reading()
            await connection.wait_closed()
        async for message in connection:
            if self._behaviour == "closes":
                return
            if self._behaviour == "drips":
                for char in message:
                    await connection.send(str(char))
                    await asyncio.sleep(0.01)
            while self._behaviour == "floods":
                await connection.send(message)
            if self._behaviour == "echo":
                await connection.send(message)
