"""A rosbridge server that treats a first message as the real one does, played by a test.

It works its operations off one by one, keeps a message for a second until a subscriber has
connected to the topic, and forgets whatever is left when the client is gone.
"""

import asyncio
import json
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager, suppress
from typing import Any

from websockets.asyncio.server import ServerConnection, serve

__all__ = ["ShyBridge", "shy_bridge"]

WORK_S = 0.05
"""What each operation takes."""
CONNECTS_S = 0.3
"""After so long a subscriber has connected to a topic that is advertised."""


class ShyBridge:
    """What arrived at the robot's subscribers, in order."""

    def __init__(self, subscribed: Iterable[str], *, has_rosapi: bool) -> None:
        """Play a bridge to a robot that subscribes to these topics."""
        self.port = 0
        self.arrived: list[tuple[str, Any]] = []
        self._subscribed = set(subscribed)
        self._has_rosapi = has_rosapi

    async def meet(self, client: ServerConnection) -> None:
        """Serve one client until it is gone; what it still wanted then is forgotten."""
        waiting: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        worker = asyncio.create_task(self._work(client, waiting))
        try:
            async for frame in client:
                waiting.put_nowait(json.loads(frame))
        finally:
            worker.cancel()
            with suppress(asyncio.CancelledError):
                await worker

    async def _work(self, client: ServerConnection, waiting: "asyncio.Queue[Any]") -> None:
        async with asyncio.TaskGroup() as publishers:
            topics: dict[str, asyncio.Queue[Any]] = {}
            while True:
                operation = await waiting.get()
                await asyncio.sleep(WORK_S)
                topic = operation.get("topic", "")
                match operation["op"]:
                    case "advertise":
                        topics[topic] = asyncio.Queue()
                        publishers.create_task(self._publish(topic, topics[topic]))
                    case "publish":
                        topics[topic].put_nowait(operation["msg"])
                    case "call_service":
                        await self._answer(client, operation)

    async def _publish(self, topic: str, messages: "asyncio.Queue[Any]") -> None:
        if topic not in self._subscribed:
            return
        await asyncio.sleep(CONNECTS_S)
        while True:
            self.arrived.append((topic, await messages.get()))

    async def _answer(self, client: ServerConnection, operation: dict[str, Any]) -> None:
        is_known = self._has_rosapi and operation["service"] == "/rosapi/subscribers"
        topic = operation.get("args", {}).get("topic")
        nodes = ["/navigation"] if topic in self._subscribed else []
        said: dict[str, Any] = {
            "op": "service_response",
            "id": operation["id"],
            "service": operation["service"],
            "values": {"subscribers": nodes} if is_known else "no such service",
            "result": is_known,
        }
        await client.send(json.dumps(said))


@asynccontextmanager
async def shy_bridge(*subscribed: str, has_rosapi: bool = True) -> AsyncIterator[ShyBridge]:
    """Run one for as long as the context lasts."""
    bridge = ShyBridge(subscribed, has_rosapi=has_rosapi)
    async with serve(bridge.meet, "127.0.0.1", 0, ping_interval=None) as server:
        bridge.port = server.sockets[0].getsockname()[1]
        yield bridge
