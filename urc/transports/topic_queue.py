"""A bounded queue for received topic messages.

A fast publisher must not fill URC's memory. The publisher must not be blocked either, because one
stalled reader would freeze a topic for all clients of the bridge. Each topic therefore keeps only
its newest messages. Responses are queued separately, because a lost response is never repeated.
"""

import asyncio
from collections import deque

from urc.model.payload import LOST, Envelope
from urc.transports.base import PeerClosed

__all__ = ["TopicReceiveQueue"]

TOPIC_MESSAGES = 256
"""Maximum number of queued messages per topic."""
TOPIC_BYTES = 524_288
"""Maximum number of queued bytes per topic. A larger message, such as an image, is queued without
other messages of its topic.
"""
MESSAGES = 4096
"""Maximum number of queued messages across all topics; needed because a wildcard may match any
number of topics."""
ALL_BYTES = 33_554_432
"""Maximum number of queued bytes across all topics."""
A_TURN = 32
"""Maximum number of envelopes handled in one turn of the event loop."""
ANSWERS = 1024
"""Maximum number of queued responses and feedback messages; `ALL_BYTES` limits their total size."""


class TopicReceiveQueue:
    """A bounded queue of envelopes in order of arrival; topics keep only their newest messages."""

    def __init__(self) -> None:
        self._waiting: dict[int, Envelope] = {}
        """Queued envelopes in order of arrival, keyed by sequence number."""
        self._topics: dict[str, deque[tuple[int, int]]] = {}
        """Sequence number and size in bytes of each queued message, keyed by topic."""
        self._sizes: dict[str, int] = {}
        self._bytes = 0
        self._messages = 0
        self._answers: dict[int, int] = {}
        """Size of each queued response in bytes, keyed by sequence number."""
        self._answers_bytes = 0
        self._ordered: dict[str, bool] = {}
        """Whether messages were lost before the next one, keyed by the topics of videos."""
        self._number = 0
        self._arrived = asyncio.Event()
        self._ended: str | None = None
        self.dropped = 0
        """Number of envelopes dropped so far."""
        self.arrivals = 0
        """Number of messages that have arrived from the robot, whether queued or not."""

    def note_arrival(self) -> None:
        """Record a message from the robot, which may be queued later or not at all.

        Envelopes that URC itself makes are queued without a call of this method.
        """
        self.arrivals += 1

    def keep_groups(self, topic: str) -> None:
        """Mark the next message of a topic, and each message after a loss, with `LOST`.

        A video needs the mark: after a loss, its images can be decoded only from a keyframe on.
        """
        self._ordered[topic] = True

    def message(self, topic: str, envelope: Envelope, size_bytes: int) -> None:
        """Add a message of `topic`; drop the oldest messages if a limit is exceeded."""
        queue = self._topics.get(topic)
        if queue is None:
            queue = self._topics[topic] = deque()
            self._sizes[topic] = 0
        while queue and (
            len(queue) >= TOPIC_MESSAGES or self._sizes[topic] + size_bytes > TOPIC_BYTES
        ):
            self._drop(topic, queue[0][0])
            queue = self._topics.setdefault(topic, queue)
            self._sizes.setdefault(topic, 0)
        self._sizes[topic] += size_bytes
        self._bytes += size_bytes
        self._messages += 1
        queue.append((self._add(envelope), size_bytes))
        while self._messages > 1 and (self._messages > MESSAGES or self._bytes > ALL_BYTES):
            self._drop_oldest()

    def answer(self, envelope: Envelope, size_bytes: int = 0) -> None:
        """Add a response or feedback message; if the queue is full, drop the new message."""
        is_full = self._answers and self._answers_bytes + size_bytes > ALL_BYTES
        if len(self._answers) >= ANSWERS or is_full:
            self.dropped += 1
            return
        self._answers[self._add(envelope)] = size_bytes
        self._answers_bytes += size_bytes

    def end(self, reason: str) -> None:
        """End the queue; the envelopes that it already contains can still be read."""
        if self._ended is None:
            self._ended = reason
        self._arrived.set()

    @property
    def ended(self) -> str | None:
        """Why the connection ended; None while the connection is open."""
        return self._ended

    @property
    def is_filling(self) -> bool:
        """Whether the reader should pause to let the consumer run."""
        return len(self._waiting) >= A_TURN

    async def pop(self) -> Envelope:
        """Return the next envelope; raise `PeerClosed` when the queue has ended."""
        while not self._waiting:
            if self._ended is not None:
                raise PeerClosed(self._ended)
            self._arrived.clear()
            await self._arrived.wait()
        number = next(iter(self._waiting))
        envelope = self._waiting.pop(number)
        if envelope.verb != "message":
            self._answers_bytes -= self._answers.pop(number)
            return envelope
        topic = str(envelope.attributes["topic"])
        self._forget(topic)
        if self._ordered.get(topic):
            self._ordered[topic] = False
            return envelope._replace(attributes={**envelope.attributes, LOST: True})
        return envelope

    def _add(self, envelope: Envelope) -> int:
        self._number += 1
        self._waiting[self._number] = envelope
        self._arrived.set()
        return self._number

    def _drop(self, topic: str, number: int) -> None:
        """Drop the oldest message of `topic`, which has the sequence number `number`."""
        del self._waiting[number]
        self._forget(topic)
        self.dropped += 1
        if topic in self._ordered:
            self._ordered[topic] = True

    def _drop_oldest(self) -> None:
        for number, envelope in self._waiting.items():
            if envelope.verb == "message":
                self._drop(str(envelope.attributes["topic"]), number)
                return

    def _forget(self, topic: str) -> None:
        """Update the counters after the oldest message of `topic` was removed."""
        queue = self._topics[topic]
        _, size = queue.popleft()
        self._bytes -= size
        self._messages -= 1
        if queue:
            self._sizes[topic] -= size
        else:  # a wildcard may match any number of topics
            del self._topics[topic], self._sizes[topic]
