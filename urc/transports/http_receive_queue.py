"""A bounded queue for received HTTP responses, images and events."""

import asyncio
from collections.abc import Mapping

from urc.model.payload import Envelope
from urc.transports.base import PeerClosed

__all__ = ["HttpReceiveQueue"]

EVENTS_BYTES = 1_048_576
"""Maximum size of queued events and lines, in bytes; a full queue pauses reading from the robot."""
EVENTS = 64


class HttpReceiveQueue:
    """A bounded queue of responses, images and events, in order of arrival.

    A newer image replaces the queued image of the same topic.
    """

    def __init__(self) -> None:
        self._waiting: dict[object, Envelope] = {}
        """Queued envelopes; the key is an image's topic, or a number for other envelopes."""
        self._number = 0
        self._events = 0
        self._events_bytes = 0
        self._arrived = asyncio.Event()
        self._has_room = asyncio.Event()
        self._has_room.set()
        self._ended: str | None = None
        self.dropped = 0
        """Number of images that newer images have replaced."""

    def answer(self, place: int, envelope: Envelope) -> None:
        """Add a request's response; the limit on requests also limits the number of responses."""
        self._waiting["answer", place] = envelope
        self._arrived.set()

    def forget(self, place: int) -> None:
        """Remove the unread response to a request that was dropped."""
        self._waiting.pop(("answer", place), None)

    def picture(self, topic: str, body: bytes) -> None:
        """Add an image, which replaces a queued image of the same topic."""
        self.dropped += topic in self._waiting
        self._waiting[topic] = Envelope("message", {"topic": topic, "dropped": self.dropped}, body)
        self._arrived.set()

    async def event(self, attributes: Mapping[str, object], body: bytes) -> None:
        """Add an event or a line; wait while the queue is full."""
        while self._events >= EVENTS or self._events_bytes >= EVENTS_BYTES:
            self._has_room.clear()
            await self._has_room.wait()
        self._events += 1
        self._events_bytes += len(body)
        self._number += 1
        self._waiting["event", self._number] = Envelope("message", attributes, body)
        self._arrived.set()

    def end(self, reason: str) -> None:
        """End the queue; the envelopes that it already contains can still be read."""
        if self._ended is None:
            self._ended = reason
        self._arrived.set()
        self._has_room.set()

    @property
    def ended(self) -> str | None:
        """Why the queue ended; None while the connection is open."""
        return self._ended

    async def pop(self) -> tuple[Envelope, int | None]:
        """Return the next envelope, and its request's number if the envelope is a response.

        Raises:
            PeerClosed: the queue is empty and has ended.
        """
        while not self._waiting:
            if self._ended is not None:
                raise PeerClosed(self._ended)
            self._arrived.clear()
            await self._arrived.wait()
        where = next(iter(self._waiting))
        envelope = self._waiting.pop(where)
        if not isinstance(where, tuple):
            return envelope, None
        kind, number = where
        if kind == "answer":
            return envelope, number
        self._events -= 1
        self._events_bytes -= len(envelope.body) if isinstance(envelope.body, bytes) else 0
        self._has_room.set()
        return envelope, None
