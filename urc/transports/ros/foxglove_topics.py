"""The topics of a robot behind a Foxglove protocol server: channels and the connection graph.

A channel names a topic and its type, but not whether the type is published or subscribed to. The
connection graph names the nodes of each topic, but no types. URC's own publishers also appear as
channels, so the type of a topic that URC alone publishes is not reported. No I/O.
"""

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from urc.model.payload import Envelope
from urc.transports.ros.foxglove_frames import AdvertisedChannel
from urc.transports.ros.goal_status import STATUS
from urc.transports.ros.graph import version_of
from urc.transports.ros.topic_list import MAX_TOPICS, TopicRow, answer_of, short_type, wanted_of

__all__ = ["FoxgloveTopics", "DrivenChannel", "TopicWish"]

MAX_GRAPH: Final = 4096
"""Maximum number of topics with known publishers, and of topics with known subscribers."""
_NODES: Final = 16
"""Maximum number of nodes that are stored for each topic."""
_NAME: Final = 256
"""Maximum length of a stored name, in characters; longer names of topics are ignored."""


class TopicWish(NamedTuple):
    """A topic that the driver subscribes to."""

    topic: str
    type: str = ""
    throttle_s: float = 0.0


class DrivenChannel:
    """A subscribed topic, with the earliest time of its next message."""

    __slots__ = ("channel", "due_s", "is_status", "late", "number", "received", "wish")

    def __init__(self, wish: TopicWish, channel: AdvertisedChannel, number: int) -> None:
        self.wish, self.channel, self.number = wish, channel, number
        self.is_status = wish.topic.endswith(STATUS)
        self.due_s = float("-inf")
        self.received = 0
        """Number of received messages."""
        self.late: bytes | None = None
        """Newest message that arrived too soon and must be delivered later, or None."""


class FoxgloveTopics:
    """The nodes of one connection's topics."""

    def __init__(self) -> None:
        self.is_known = False
        """Whether the bridge reports the publishers and subscribers of topics."""
        self._publishers: dict[str, tuple[str, ...]] = {}
        self._subscribers: dict[str, tuple[str, ...]] = {}
        self._own: set[tuple[str, str]] = set()
        """Topics and types of which URC's own publisher was the first."""

    def update(self, said: Mapping[str, Any]) -> None:
        """Apply a ``connectionGraphUpdate``."""
        self.is_known = True
        _store(self._publishers, said.get("publishedTopics"), "publisherIds")
        _store(self._subscribers, said.get("subscribedTopics"), "subscriberIds")
        removed = said.get("removedTopics")
        for name in removed if isinstance(removed, list) else ():
            self._publishers.pop(str(name), None)
            self._subscribers.pop(str(name), None)

    def subscribers_of(self, topic: str) -> tuple[str, ...] | None:
        """Return the nodes that subscribe to a topic; None if the nodes are unknown."""
        return self._subscribers.get(topic, ()) if self.is_known else None

    def publishers_of(self, topic: str) -> tuple[str, ...]:
        """Return the nodes that publish a topic, as far as they are known."""
        return self._publishers.get(topic, ())

    def announced(self, topic: str, kind: str, channels: Iterable[AdvertisedChannel]) -> None:
        """Record that URC publishes a topic; `channels` are the robot's channels before."""
        name = short_type(kind)
        if all(one.topic != topic or short_type(one.type) != name for one in channels):
            self._own.add((topic, name))

    def answer(
        self,
        request: Envelope,
        channels: Iterable[AdvertisedChannel],
        received: Mapping[str, int],
    ) -> Envelope:
        """Return the answer to a request for topics.

        Args:
            request: the request.
            channels: the robot's channels.
            received: number of received messages, keyed by subscribed topic.
        """
        names, is_all = wanted_of(request)
        types: dict[str, dict[str, None]] = {}
        every = []
        for one in channels:
            every.append(one.type)
            if (one.topic, short_type(one.type)) not in self._own:
                types.setdefault(one.topic, {})[one.type] = None
        known = {*types, *self._publishers, *self._subscribers}
        others = sorted(known - {*names})[:MAX_TOPICS] if is_all else []
        rows = [self._row(name, types, received) for name in (*names, *others)]
        return answer_of(rows, len(known), version_of(every), is_all=is_all)

    def _row(
        self, name: str, types: Mapping[str, Mapping[str, None]], received: Mapping[str, int]
    ) -> TopicRow:
        kinds = tuple(types[name]) if name in types else None
        publishers = self._publishers.get(name, ()) if self.is_known else None
        return TopicRow(
            name, kinds, kinds, publishers, self.subscribers_of(name), received.get(name)
        )


def _store(nodes: dict[str, tuple[str, ...]], listed: object, ids: str) -> None:
    """Store the nodes of each listed topic, up to the maximum number of topics."""
    for one in listed if isinstance(listed, list) else ():
        name = one.get("name") if isinstance(one, Mapping) else None
        if not isinstance(name, str) or len(name) > _NAME:
            continue
        if name in nodes or len(nodes) < MAX_GRAPH:
            found = one.get(ids)
            told = found[:_NODES] if isinstance(found, list) else ()
            nodes[name] = tuple(sorted({str(node)[:_NAME] for node in told}))
