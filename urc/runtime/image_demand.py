"""Pausing of image topics without viewers, to save bandwidth.

Layer 4. A bridge sends a subscribed camera at its full rate, even if every page shows another
camera. URC therefore unsubscribes from a topic while its images have no viewers, and subscribes
again for the next viewer. The robot remains connected: a topic is paused only while another
topic of the same connection delivers messages. If the connection falls silent after a pause, URC
subscribes to all its topics and never pauses them again in this session. A transport of the type
`camera` is paused as a whole: it closes its connection until the next viewer.

A camera may have a low stream for pages on slow lines. URC opens it for its first viewer only.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Final, NamedTuple

from urc.model.driver import Driver
from urc.model.payload import Envelope
from urc.model.values import Value
from urc.protocol.forms.topics import ReadTopic, read_topics
from urc.runtime.clock import Clock, within
from urc.runtime.hub import Hub
from urc.runtime.image_viewers import low_stream
from urc.transports.base import LOW_STREAM

__all__ = ["PAUSE_AFTER_S", "ImageDemand", "PausableTopics", "low_streams", "pausable_topics"]

PAUSE_AFTER_S: Final = 2.0
"""Time without viewers before a topic is paused, so that a page can swap two cameras quickly."""
CHECK_S: Final = 1.0
MAX_LIVE_S: Final = 10.0
"""Longest `stale_after` of an image whose topic may be paused, in seconds. An image that stays live
for longer would look live to the next viewer, although the robot may have sent a newer one."""
_TRANSPORTS: Final = ("ros",)
"""Transport types that can subscribe and unsubscribe during a connection."""
_IMAGES: Final = ("image", "point_cloud", "video")
"""Types of the signals whose topics may be paused: frequent messages with many bytes."""


class PausableTopics(NamedTuple):
    """The topics of one transport that carry only images, and the signals of its other topics.

    A camera has one topic without a name, and no other topics.
    """

    images: Mapping[str, frozenset[str]]
    """Image signals of each topic that may be paused, keyed by topic."""
    others: frozenset[str]
    """Signals that the other topics set. They show that the connection still delivers data."""
    fresh_s: float
    """Maximum age of the newest of these signals if the connection delivers data, in seconds."""


def pausable_topics(driver: Driver, settings: Mapping[str, Value]) -> dict[str, PausableTopics]:
    """Return the topics that may be paused, keyed by transport.

    All readings of such a topic are images without alarm limits, which are live for `MAX_LIVE_S`
    seconds at most. No formula, requirement or reply needs them, and another topic of the transport
    remains.
    """
    used = {name for one in driver.signals.values() if one.formula for name in one.formula.names}
    for command in driver.commands.values():
        used.update(name for need in command.requires for name in need.condition.names)
    images = {
        name
        for name, one in driver.signals.items()
        if one.type in _IMAGES and name not in used and one.limits.is_empty
        if 0 < one.stale_after_s <= MAX_LIVE_S
    }
    found, lows = {}, low_streams(driver)
    for name, spec in driver.transports.items():
        if spec.is_camera:  # its connection ends during a pause, so silence is expected
            fields = _fields_of(driver, name)
            topics = {"": fields} if fields and fields <= images else {}
            if name in lows:
                topics[LOW_STREAM] = frozenset(map(low_stream, lows[name]))
            if topics:
                found[name] = PausableTopics(topics, frozenset(), 0.0)
        elif spec.type in _TRANSPORTS:
            read = read_topics(driver, name, settings)
            paused = {topic: one.fields for topic, one in read.items() if _may(one, images)}
            others = {
                field for topic, one in read.items() if topic not in paused for field in one.fields
            }
            if paused and others:
                fresh_s = spec.stale_after_s or PAUSE_AFTER_S
                found[name] = PausableTopics(paused, frozenset(others), fresh_s)
    return found


def low_streams(driver: Driver) -> dict[str, frozenset[str]]:
    """Return the signals of each camera with a low stream, keyed by transport."""
    return {
        name: _fields_of(driver, name)
        for name, spec in driver.transports.items()
        if spec.is_camera and spec.options.get("streams")
    }


def _fields_of(driver: Driver, transport: str) -> frozenset[str]:
    messages = [one for one in driver.messages.values() if one.transport == transport]
    return frozenset(field for one in messages for field in one.read.fields)


def _may(topic: ReadTopic, images: set[str]) -> bool:
    return topic.is_only_listened and bool(topic.fields) and topic.fields <= images


class ImageDemand:
    """Pauses and resumes the image topics of an open session, as viewers come and go."""

    def __init__(
        self,
        topics: Mapping[str, PausableTopics],
        hub: Hub,
        send: Callable[[str, Envelope], None],
        clock: Clock,
    ) -> None:
        """Start with all topics subscribed, as the transports do.

        Args:
            topics: result of `pausable_topics`.
            hub: hub of the session, which counts the viewers of each image.
            send: function that sends an envelope on a connected transport.
            clock: source of time.
        """
        self._topics = topics
        self._hub = hub
        self._send = send
        self._clock = clock
        self._paused: set[tuple[str, str]] = set()
        """Paused topics, each with its transport."""
        self._unseen_s: dict[tuple[str, str], float] = {}
        """Time at which a topic lost its last viewer."""
        self._since_s: dict[str, float] = {}
        """Start time of each transport's current state, which changes with each connection."""
        self._kept: set[str] = set()
        """Transports that fell silent after a pause; their topics remain subscribed."""

    async def run(self) -> None:
        """Follow the viewers until cancelled; return at once if no topic may be paused."""
        while self._topics:
            self.check()
            changed = self._hub.viewers.changed
            with suppress(TimeoutError):
                async with within(self._clock, CHECK_S):
                    await changed.wait()
            changed.clear()

    def check(self) -> None:
        """Pause and resume topics according to the current viewers and connections."""
        now_s = self._clock.now()
        for transport, topics in self._topics.items():
            if self._is_connected(transport):
                for topic, signals in topics.images.items():
                    self._check_topic((transport, topic), signals, now_s)

    def _is_connected(self, transport: str) -> bool:
        """Return whether the transport is live; notice a new connection, and silence."""
        status = self._hub.links.get(transport)
        if status is None:
            return False
        if status.state == "silent" and any(one == transport for one, _ in self._paused):
            self._kept.add(transport)
            for topic in [topic for one, topic in self._paused if one == transport]:
                self._resume((transport, topic))
        if self._since_s.get(transport) != status.since_s:
            self._since_s[transport] = status.since_s
            # A new connection starts with all topics subscribed, and without the low stream.
            self._paused = {one for one in self._paused if one[0] != transport}
            if LOW_STREAM in self._topics[transport].images:
                self._paused.add((transport, LOW_STREAM))
        return status.state == "live"

    def _check_topic(self, place: tuple[str, str], signals: frozenset[str], now_s: float) -> None:
        if place[0] in self._kept or self._hub.viewers.sees(signals, now_s):
            self._unseen_s.pop(place, None)
            if place in self._paused:
                self._resume(place)
            return
        since_s = self._unseen_s.setdefault(place, now_s)
        is_due = place not in self._paused and now_s - since_s >= PAUSE_AFTER_S
        if is_due and self._delivers_others(place[0], now_s):
            self._paused.add(place)
            self._send(place[0], Envelope("unsubscribe", {"topic": place[1]}))

    def _resume(self, place: tuple[str, str]) -> None:
        self._paused.discard(place)
        self._send(place[0], Envelope("subscribe", {"topic": place[1]}))

    def _delivers_others(self, transport: str, now_s: float) -> bool:
        topics = self._topics[transport]
        if not topics.others:
            return True  # a camera, which delivers nothing else
        samples = filter(None, map(self._hub.latest, topics.others))
        return any(now_s - one.time_s <= topics.fresh_s for one in samples)
