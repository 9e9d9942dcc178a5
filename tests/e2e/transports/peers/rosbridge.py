"""A rosbridge server with a robot behind it, run by the test."""

import asyncio
import json
from contextlib import suppress

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from tests.e2e.transports.peers.base import Behaviour, Traits
from tests.e2e.transports.peers.tcp import TcpPeer
from urc.model.payload import Envelope
from urc.transports.base import TopicSubscription, Transport, TransportSetup
from urc.transports.ros.choice import from_setup

__all__ = ["RosbridgePeer"]

SAID = json.dumps({"op": "publish", "topic": "/answer", "msg": {"data": "42 %"}})


class RosbridgePeer(TcpPeer):
    """Answers what is published to ``/ask`` with a message on ``/answer``."""

    traits = Traits(is_stream=False)
    ask = Envelope("publish", {"topic": "/ask", "type": "std_msgs/String"}, {"data": "how much?"})
    answer = Envelope("message", {"topic": "/answer"}, {"data": "42 %"})

    def __init__(self) -> None:
        super().__init__()
        self._bridge: Server | None = None
        self._behaviour: Behaviour = "echo"
        self._clients: set[ServerConnection] = set()

    async def start(self, behaviour: Behaviour) -> Transport:
        """Listen; a bridge that refuses or is mute needs no WebSocket."""
        if behaviour in ("refuses", "mute"):
            return await super().start(behaviour)
        self._listener.bind(("127.0.0.1", 0))
        self._begin(self._listener.getsockname()[1])
        self._behaviour = behaviour
        self._bridge = await serve(
            self._meet, sock=self._listener, compression=None, ping_interval=None, max_queue=4
        )
        return self.transport()

    def transport(self) -> Transport:
        """Return a line that leads here."""
        options = {"host": "127.0.0.1", "port": self.port}
        return from_setup(TransportSetup("wire", options, (TopicSubscription("/answer"),)))

    async def stop(self) -> None:
        """Let packets pass again and cut every client off."""
        if self._loss is not None:
            await self._loss.end()
        for client in self._clients:
            client.transport.abort()
        if self._bridge is not None:
            self._bridge.close(close_connections=False)
            await self._bridge.wait_closed()
        await super().stop()

    async def _meet(self, client: ServerConnection) -> None:
        self._clients.add(client)
        try:
            with suppress(ConnectionClosed):
                await self._behave(client)
        finally:
            self._clients.discard(client)

    async def _behave(self, client: ServerConnection) -> None:
        if self._behaviour == "deaf":
            client.transport.pause_reading()
            await client.wait_closed()
        async for frame in client:
            if json.loads(frame)["op"] != "publish" or self._behaviour == "silent":
                continue
            if self._behaviour == "closes":
                return
            await self._say(client)

    async def _say(self, client: ServerConnection) -> None:
        while self._behaviour == "floods":
            await client.send(SAID)
        if self._behaviour != "drips":
            await client.send(SAID)
            return
        for number, letter in enumerate(SAID):
            piece = {"op": "fragment", "id": "1", "data": letter, "num": number, "total": len(SAID)}
            await client.send(list(json.dumps(piece)))  # each letter a WebSocket frame of its own
            await asyncio.sleep(0.002)
