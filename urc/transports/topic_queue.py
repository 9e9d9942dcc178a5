"""The bounded queue of received topic messages.

A fast publisher must neither be blocked nor fill our memory: one stalled reader would freeze a
topic for all clients. Each topic therefore keeps its newest messages. Responses are kept
separately, since they are not repeated.
"""

import asyncio
from collections import deque

from urc.model.payload import Envelope
from urc.transports.base import PeerClosed

__all__ = ["TopicReceiveQueue"]

TOPIC_MESSAGES = 256
"""Limit of queued messages per topic."""
TOPIC_BYTES = 524_288
"""Limit of queued bytes per topic; a single larger message (an image) is queued alone."""
MESSAGES = 4096
"""Limit of queued messages of all topics; a wildcard may match any number of them."""
ALL_BYTES = 33_554_432
"""Limit of queued bytes of all topics."""
A_TURN = 32
"""Envelopes per turn of the event loop."""
ANSWERS = 1024
"""Limit of queued responses and feedback; `ALL_BYTES` bounds their size, too."""


class TopicReceiveQueue:
    """A bounded queue of envelopes in the order of arrival; each topic keeps its newest ones."""

    def __init__(self) -> None:
        self._waiting: dict[int, Envelope] = {}
        """Number → envelope, in the order of arrival."""
        self._topics: dict[str, deque[tuple[int, int]]] = {}
        """Topic → number and size of each of its messages."""
        self._sizes: dict[str, int] = {}
        self._bytes = 0
        self._messages = 0
        self._answers: dict[int, int] = {}
        """Number → size of each queued response."""
        self._answers_bytes = 0
        self._number = 0
        self._arrived = asyncio.Event()
        self._ended: str | None = None
        self.dropped = 0
        """Number of dropped envelopes."""

    def message(self, topic: str, envelope: Envelope, size_bytes: int) -> None:
        """Add a message of `topic`, dropping old ones as necessary."""
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
        """Add a response or feedback; it is dropped if the queue is full."""
        is_full = self._answers and self._answers_bytes + size_bytes > ALL_BYTES
        if len(self._answers) >= ANSWERS or is_full:
            self.dropped += 1
            return
        self._answers[self._add(envelope)] = size_bytes
        self._answers_bytes += size_bytes

    def end(self, reason: str) -> None:
        """End the queue; queued envelopes can still be read."""
        if self._ended is None:
            self._ended = reason
        self._arrived.set()

    @property
    def ended(self) -> str | None:
        """Reason of the end; None while the connection is open."""
        return self._ended

    @property
    def is_filling(self) -> bool:
        """Whether the reader should yield to the consumer."""
        return len(self._waiting) >= A_TURN

    async def pop(self) -> Envelope:
        """Return the next envelope; raise `PeerClosed` at the end."""
        while not self._waiting:
            if self._ended is not None:
                raise PeerClosed(self._ended)
            self._arrived.clear()
            await self._arrived.wait()
        number = next(iter(self._waiting))
        envelope = self._waiting.pop(number)
        if envelope.verb == "message":
            self._forget(str(envelope.attributes["topic"]))
        else:
            self._answers_bytes -= self._answers.pop(number)
        return envelope

    def _add(self, envelope: Envelope) -> int:
        self._number += 1
        self._waiting[self._number] = envelope
        self._arrived.set()
        return self._number

    def _drop(self, topic: str, number: int) -> None:
        """Drop the oldest message of `topic`, which has that number."""
        del self._waiting[number]
        self._forget(topic)
        self.dropped += 1

    def _drop_oldest(self) -> None:
        for number, envelope in self._waiting.items():
            if envelope.verb == "message":
                self._drop(str(envelope.attributes["topic"]), number)
                return

    def _forget(self, topic: str) -> None:
        """Update the counts after the removal of the oldest message of `topic`."""
        queue = self._topics[topic]
        _, size = queue.popleft()
        self._bytes -= size
        self._messages -= 1
        if queue:
            self._sizes[topic] -= size
        else:  # the number of topics behind a wildcard is unlimited
            del self._topics[topic], self._sizes[topic]
