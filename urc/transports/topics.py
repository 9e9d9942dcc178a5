"""What has arrived on a line of topics and has not been taken yet.

A robot that publishes faster than its messages are taken must neither be held up (one stalled
reader freezes a topic for everybody) nor fill our memory. So each topic keeps its newest messages,
and of the others the oldest go; answers are kept apart, since nobody repeats them.
"""

import asyncio
from collections import deque

from urc.model.codec import Envelope
from urc.transports.base import PeerClosed

__all__ = ["Inbox"]

TOPIC_MESSAGES = 256
"""Messages of one topic that wait at most."""
TOPIC_BYTES = 524_288
"""Size of all of them; a single larger one (an image) waits alone."""
MESSAGES = 4096
"""Messages of all topics together: behind a wildcard there may be any number."""
ALL_BYTES = 33_554_432
"""Size of all of them."""
A_TURN = 32
"""Envelopes after which a reader lets the others have their turn on the loop."""
ANSWERS = 1024
"""Responses and pieces of feedback that wait at most; their size is bounded by `ALL_BYTES`, too."""


class Inbox:
    """A bounded queue of envelopes in the order of their arrival; newest wins topic by topic."""

    def __init__(self) -> None:
        self._waiting: dict[int, Envelope] = {}
        """By number, in the order of arrival."""
        self._topics: dict[str, deque[tuple[int, int]]] = {}
        """Topic → number and size of each of its messages."""
        self._sizes: dict[str, int] = {}
        self._bytes = 0
        self._messages = 0
        self._answers: dict[int, int] = {}
        """Number → size of each answer that waits."""
        self._answers_bytes = 0
        self._number = 0
        self._arrived = asyncio.Event()
        self._ended: str | None = None
        self.dropped = 0
        """Envelopes that were given up for newer ones."""

    def message(self, topic: str, envelope: Envelope, size_bytes: int) -> None:
        """Add a message of `topic`, and give up as many old ones as it needs."""
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
        """Add a response or a piece of feedback; one too many is given up."""
        is_full = self._answers and self._answers_bytes + size_bytes > ALL_BYTES
        if len(self._answers) >= ANSWERS or is_full:
            self.dropped += 1
            return
        self._answers[self._add(envelope)] = size_bytes
        self._answers_bytes += size_bytes

    def end(self, reason: str) -> None:
        """No more will come; what waits can still be taken."""
        if self._ended is None:
            self._ended = reason
        self._arrived.set()

    @property
    def ended(self) -> str | None:
        """Why no more will come; None while the line is up."""
        return self._ended

    @property
    def is_filling(self) -> bool:
        """Whether so much waits that whoever takes it should have a turn now."""
        return len(self._waiting) >= A_TURN

    async def take(self) -> Envelope:
        """Return the next envelope; raise `PeerClosed` when no more will come."""
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
        """Give up the oldest message of `topic`, which has that number."""
        del self._waiting[number]
        self._forget(topic)
        self.dropped += 1

    def _drop_oldest(self) -> None:
        for number, envelope in self._waiting.items():
            if envelope.verb == "message":
                self._drop(str(envelope.attributes["topic"]), number)
                return

    def _forget(self, topic: str) -> None:
        """Strike the oldest message of `topic`, which is not waiting any more."""
        queue = self._topics[topic]
        _, size = queue.popleft()
        self._bytes -= size
        self._messages -= 1
        if queue:
            self._sizes[topic] -= size
        else:  # topics behind a wildcard are without end
            del self._topics[topic], self._sizes[topic]
