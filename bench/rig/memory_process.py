"""A real ``urc serve`` whose ROS robots are in memory: a separate program.

``python -m bench.rig.memory_process serve …`` starts the server. Each transport ``ros`` delivers
the messages of `bench.peers.ros_streams` at their rates. The messages are already decoded, and
those of one display frame arrive together. The processor time of this server is the part that all
lines share: the queue of messages, the engine, the hub and the page's feed.
"""

import asyncio
import sys

from bench.peers.ros_streams import MESSAGES, RATES
from bench.rig.ros_messages import plain
from urc.cli.main import main
from urc.model.payload import Envelope, Payload, size_of
from urc.transports.base import Transport, TransportSetup
from urc.transports.ros import choice
from urc.transports.topic_queue import TopicReceiveQueue
from urc.transports.websocket import GATHER_S

BODIES = {f"/{topic}": [plain(one) for one in made] for topic, made in MESSAGES.items()}
"""Decoded messages of each topic."""


class RobotInMemory:
    """A transport to a robot that publishes the subscribed topics."""

    address = "memory"

    def __init__(self, topics: frozenset[str]) -> None:
        self._topics = topics
        self._paused: set[object] = set()
        self._queue = TopicReceiveQueue()
        self._task: asyncio.Task[None] | None = None

    async def open(self, timeout_s: float) -> None:
        """Start to publish; the robot needs no time."""
        await self.close()
        self._queue = TopicReceiveQueue()
        self._task = asyncio.create_task(self._publish(self._queue))

    async def receive(self) -> Envelope:
        """Return the next message; raise `PeerClosed` after the last."""
        return await self._queue.pop()

    async def send(self, data: Payload) -> None:
        """Pause or resume a topic; ignore other messages."""
        if isinstance(data, Envelope) and data.verb == "unsubscribe":
            self._paused.add(data.attributes["topic"])
        elif isinstance(data, Envelope) and data.verb == "subscribe":
            self._paused.discard(data.attributes["topic"])

    async def close(self) -> None:
        """Stop publishing."""
        self._queue.end("the connection is closed")
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def _publish(self, queue: TopicReceiveQueue) -> None:
        clock = asyncio.get_running_loop().time
        began_s, counts = clock(), dict.fromkeys(self._topics, 0)
        while True:
            passed_s = clock() - began_s
            for topic, made in BODIES.items():
                while topic in counts and counts[topic] < passed_s * RATES[topic[1:]]:
                    body = made[counts[topic] % len(made)]
                    counts[topic] += 1
                    if topic not in self._paused:
                        envelope = Envelope("message", {"topic": topic}, body)
                        queue.message(topic, envelope, size_of(envelope))
            await asyncio.sleep(GATHER_S)


def from_setup(setup: TransportSetup) -> Transport:
    """Return a robot in memory with the document's topics."""
    return RobotInMemory(frozenset(one.topic for one in setup.subscriptions))


if __name__ == "__main__":
    choice.from_setup = from_setup
    sys.exit(main())
