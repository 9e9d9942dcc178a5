"""One client's subscriptions to one robot's topics, with the unsent messages.

Layer 5. The unsent messages are limited: a few readings of each signal, the newest image and the
newest state of each connection. Of a video, a few seconds are kept. If a client reads too slowly,
older readings are dropped and counted. A slow client does not affect other clients.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

from urc.model.values import BINARY_TYPES, Sample, Signal
from urc.runtime.hub import Hub, LinkStatus
from urc.web.foxglove.topics import LOG_SOURCE, HubMessages, TopicMessage, TopicSource
from urc.web.foxglove.video_queue import add_unit
from urc.wire.foxglove import encode_message_head

__all__ = ["FIRST_NOTES", "MOST_WAITING", "RobotFeed"]

MOST_WAITING: Final = 16
"""Maximum number of unsent readings per signal; for an image signal, only the newest is kept."""
FIRST_NOTES: Final = 50
"""Maximum number of earlier log entries that a new subscription receives."""

_OF_SIGNALS: Final = ("signal", "transforms")
"""Kinds of sources whose messages are made of the readings of one signal."""
_QUEUED: Final = (*_OF_SIGNALS, "place")
"""Kinds of sources whose messages wait in a queue."""


class RobotFeed:
    """The subscriptions of one client to one robot."""

    def __init__(self, wake: Callable[[], None]) -> None:
        """Start without subscriptions; `wake` is called when a message is ready to be sent."""
        self._wake = wake
        self._ids: dict[TopicSource, int] = {}
        """The client's subscription ids, keyed by the source of the messages."""
        self._waiting: dict[TopicSource, deque[Sample | TopicMessage]] = {}
        """Unsent readings and messages, keyed by subscribed signal or slot."""
        self._videos: dict[TopicSource, deque[Sample]] = {}
        """Unsent access units, keyed by subscribed video."""
        self._need_key: set[TopicSource] = set()
        """Videos of which the client needs a keyframe next."""
        self._sources: dict[str, list[TopicSource]] = {}
        """Subscribed signals and slots, keyed by the signal that changes them."""
        self._ready: dict[TopicSource, None] = {}
        """Sources with unsent messages, in the order in which their messages are sent."""
        self._seen_notes = 0
        self._seen_links: dict[str, LinkStatus] = {}
        """Last state sent for each subscribed connection."""
        self._links_count = 0
        """Number of connection state changes at the last check."""
        self._dropped = 0
        self._hub: Hub | None = None
        self._viewed: tuple[str, ...] = ()
        """Signals of which this client counts as a viewer."""
        self._messages: HubMessages | None = None

    @property
    def is_used(self) -> bool:
        """Whether the client subscribes to any topic of the robot."""
        return bool(self._ids)

    def has(self, source: TopicSource) -> bool:
        """Return whether the client subscribes to the topic of `source`."""
        return source in self._ids

    def subscribe(self, source: TopicSource, subscription: int, signal: Signal | None) -> None:
        """Add a subscription; its first message contains the newest known value.

        Args:
            source: origin of the messages.
            subscription: the client's subscription id.
            signal: the signal's declaration; None unless the source is a signal.
        """
        self._ids[source] = subscription
        if source.kind == "signal" and signal is not None and signal.type == "video":
            self._videos[source] = deque()
            self._need_key.add(source)
        elif source.kind in _QUEUED:
            is_large = signal is not None and signal.type in BINARY_TYPES
            self._waiting[source] = deque(maxlen=1 if is_large else MOST_WAITING)
        if self._hub is not None:
            self._sort()
            self._begin(source, self._hub)

    def unsubscribe(self, source: TopicSource) -> None:
        """Drop a subscription and its unsent messages."""
        self._ids.pop(source, None)
        self._ready.pop(source, None)
        self._waiting.pop(source, None)
        self._videos.pop(source, None)
        self._need_key.discard(source)
        if source.kind == "link":
            self._seen_links.pop(source.name, None)
        self._sort()

    def take_dropped(self) -> int:
        """Return the number of messages dropped since the last call."""
        dropped, self._dropped = self._dropped, 0
        return dropped

    @contextmanager
    def attached(self, hub: Hub, messages: HubMessages) -> Iterator[None]:
        """Collect messages from the hub of a session while the context is open."""
        self._hub, self._messages = hub, messages
        self._seen_notes = max(0, hub.notes_count - FIRST_NOTES)
        self._seen_links.clear()
        self._sort()
        for source in self._ids:
            self._begin(source, hub)
        try:
            with hub.passed_to(self._arrived), hub.heed(self._changed):
                yield
        finally:
            self._view(hub, ())
            self._hub = self._messages = None
            self._ready.clear()
            for waiting in self._waiting.values():
                waiting.clear()
            for units in self._videos.values():
                units.clear()
            self._need_key.update(self._videos)

    def next_message(self) -> bytes | None:
        """Remove and return the next binary message; None if no message is ready."""
        while self._ready:
            source = next(iter(self._ready))
            del self._ready[source]
            message = self._take(source)
            if message is not None:
                return encode_message_head(self._ids[source], message.time_ns) + message.data
        return None

    # -- events of the hub

    def _sort(self) -> None:
        """Map each signal to the subscribed signals and slots that it changes."""
        self._sources = {}
        for source in (*self._waiting, *self._videos):
            names = {source.name}
            if source.kind == "place":
                names = set(self._messages.signals_of(source.name) if self._messages else ())
            for name in names:
                self._sources.setdefault(name, []).append(source)
        if self._hub is not None:
            self._view(self._hub, tuple(self._sources))

    def _view(self, hub: Hub, names: tuple[str, ...]) -> None:
        hub.viewers.remove(self._viewed)
        hub.viewers.add(names)
        self._viewed = names

    def _arrived(self, samples: Sequence[Sample]) -> None:
        """Collect the readings of subscribed signals, and the messages of changed slots."""
        places: dict[TopicSource, None] = {}
        for sample in samples:
            for source in self._sources.get(sample.signal, ()):
                if source in self._videos:
                    self._push_unit(source, sample)
                elif source.kind in _OF_SIGNALS:
                    self._push(source, sample)
                else:
                    places[source] = None
        for source in places:
            self._push_place(source)

    def _push_unit(self, source: TopicSource, sample: Sample) -> None:
        """Queue an access unit of a video; drop whole groups of pictures if the client is slow."""
        waiting = self._videos[source]
        dropped, needs_key = add_unit(waiting, sample, needs_key=source in self._need_key)
        self._dropped += dropped
        (self._need_key.add if needs_key else self._need_key.discard)(source)
        if waiting:
            self._mark(source)
        else:
            self._ready.pop(source, None)

    def _push(self, source: TopicSource, item: Sample | TopicMessage) -> None:
        waiting = self._waiting[source]
        self._dropped += len(waiting) == waiting.maxlen
        waiting.append(item)
        self._mark(source)

    def _push_place(self, source: TopicSource) -> None:
        if self._hub is not None and self._messages is not None:
            message = self._messages.of_place(source.name, self._hub)
            if message is not None:
                self._push(source, message)

    def _changed(self) -> None:
        """Queue a new log entry or a new connection state."""
        hub = self._hub
        if hub is None:
            return
        if hub.notes_count > self._seen_notes and LOG_SOURCE in self._ids:
            self._mark(LOG_SOURCE)
        if hub.links_count != self._links_count:
            self._links_count = hub.links_count
            for source in self._ids:
                self._look(source, hub)

    def _look(self, source: TopicSource, hub: Hub) -> None:
        """Queue the state of a connection if it differs from the last sent state."""
        if source.kind == "link":
            status = hub.links.get(source.name)
            if status is not None and status is not self._seen_links.get(source.name):
                self._mark(source)

    def _begin(self, source: TopicSource, hub: Hub) -> None:
        if source in self._videos:
            return  # the first message is the next keyframe
        if source.kind in _OF_SIGNALS:
            newest = hub.latest(source.name)
            if newest is not None:
                self._push(source, newest)
            return
        if source.kind == "place":
            self._push_place(source)
            return
        if source.kind == "log":
            self._seen_notes = max(0, hub.notes_count - FIRST_NOTES)
        self._look(source, hub)
        self._changed()

    def _mark(self, source: TopicSource) -> None:
        self._ready.setdefault(source)
        self._wake()

    # -- messages

    def _take(self, source: TopicSource) -> TopicMessage | None:
        hub, messages = self._hub, self._messages
        if hub is None or messages is None:
            return None
        if source in self._videos:
            units = self._videos[source]
            sample = units.popleft()
            if units:
                self._ready[source] = None
            return messages.of_sample(sample)
        if source.kind in _QUEUED:
            waiting = self._waiting[source]
            item = waiting.popleft()
            if waiting:
                self._ready[source] = None
            if isinstance(item, Sample) and source.kind == "transforms":
                return messages.of_tree(item)
            return messages.of_sample(item) if isinstance(item, Sample) else item
        if source.kind == "log":
            return self._take_note(hub, messages)
        status = hub.links.get(source.name)
        if status is None or status is self._seen_links.get(source.name):
            return None
        self._seen_links[source.name] = status
        return messages.of_link(status)

    def _take_note(self, hub: Hub, messages: HubMessages) -> TopicMessage | None:
        missing = hub.notes_count - self._seen_notes
        lost = max(0, missing - len(hub.notes))
        self._dropped += lost
        self._seen_notes += lost
        missing -= lost
        if not missing:
            return None
        self._seen_notes += 1
        if missing > 1:
            self._ready[LOG_SOURCE] = None
        return messages.of_note(hub.notes[-missing])
