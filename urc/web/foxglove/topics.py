"""A robot's data as Foxglove topics.

Layer 5. Pure. Each signal is a topic. The names of all other topics begin with ``/ROBOT/urc/``,
because a signal may have any name.
"""

import json
from collections.abc import Callable, Collection
from typing import Literal, NamedTuple

from urc.model.profile import Profile
from urc.model.values import Sample
from urc.runtime.hub import Hub, LinkStatus, LogEntry
from urc.runtime.json_messages import (
    LINK_SCHEMA,
    LOG_SCHEMA,
    MessageSchema,
    link_message,
    log_message,
    sample_message,
    signal_schema,
)
from urc.runtime.place_messages import place_sources
from urc.runtime.transform_messages import TRANSFORMS_SCHEMA, transforms_message

__all__ = ["LOG_SOURCE", "HubMessages", "TopicMessage", "RobotTopic", "TopicSource", "robot_topics"]

_LAST_NS = 2**63 - 1


class TopicSource(NamedTuple):
    """The origin of a topic's messages in a robot's hub."""

    kind: Literal["signal", "place", "transforms", "log", "link"]
    name: str = ""
    """Name of the signal, slot or transport; for transforms, the name of the tree's signal."""


LOG_SOURCE = TopicSource("log")


class RobotTopic(NamedTuple):
    """One topic of a robot."""

    topic: str
    source: TopicSource
    schema_name: str
    schema: str
    """JSON Schema of the messages, as JSON text."""


class TopicMessage(NamedTuple):
    """One message of a topic."""

    time_ns: int
    """Receive time, in nanoseconds since 1970."""
    data: bytes
    """JSON text."""


def robot_topics(robot: str, profile: Profile) -> tuple[RobotTopic, ...]:
    """Return a robot's topics; `robot` is the robot's name in URLs."""
    driver = profile.driver
    found = [
        _topic(f"/{robot}/{signal.name}", TopicSource("signal", signal.name), signal_schema(signal))
        for signal in driver.signals.values()
    ]
    for one in place_sources(robot, profile):
        found.append(
            _topic(f"/{robot}/urc/widget/{one.slot}", TopicSource("place", one.slot), one.shape)
        )
    for signal in driver.signals.values():
        if signal.type == "transform_tree":  # a driver has at most one
            source = TopicSource("transforms", signal.name)
            found.append(_topic(f"/{robot}/urc/transforms", source, TRANSFORMS_SCHEMA))
    found.append(_topic(f"/{robot}/urc/log", LOG_SOURCE, LOG_SCHEMA))
    for name in driver.transports:
        found.append(_topic(f"/{robot}/urc/link/{name}", TopicSource("link", name), LINK_SCHEMA))
    return tuple(found)


def _topic(topic: str, source: TopicSource, shape: MessageSchema) -> RobotTopic:
    return RobotTopic(topic, source, shape.name, json.dumps(shape.schema))


class HubMessages:
    """The messages of one hub; all clients share the newest message of each topic."""

    def __init__(self, robot: str, profile: Profile, utc_ns: Callable[[float], int]) -> None:
        """Start without messages.

        Args:
            robot: name of the robot in URLs.
            profile: profile of the robot.
            utc_ns: function that converts seconds on the hub's clock to nanoseconds since 1970.
        """
        self._signals = profile.driver.signals
        self._places = {one.slot: one for one in place_sources(robot, profile)}
        self._utc_ns = utc_ns
        self._prefix = f"{robot}/"
        """Text before the names of coordinate frames, as in the messages of widgets."""
        self._newest: dict[str, tuple[Sample, TopicMessage]] = {}
        self._newest_trees: dict[str, tuple[Sample, TopicMessage | None]] = {}
        self._newest_places: dict[str, tuple[int, TopicMessage | None]] = {}
        """Hub revision and newest message of each slot."""

    def signals_of(self, slot: str) -> Collection[str]:
        """Return the signals that change the message of a slot."""
        place = self._places.get(slot)
        return place.inputs.values() if place is not None else ()

    def of_place(self, slot: str, hub: Hub) -> TopicMessage | None:
        """Return the newest message of a slot; None if the slot has no value yet."""
        known = self._newest_places.get(slot)
        if known is not None and known[0] == hub.revision:
            return known[1]
        place = self._places.get(slot)
        found = place.message(hub.latest, self._time) if place is not None else None
        message = TopicMessage(*found) if found is not None else None
        self._newest_places[slot] = hub.revision, message
        return message

    def of_sample(self, sample: Sample) -> TopicMessage:
        """Return the message for a reading."""
        known = self._newest.get(sample.signal)
        if known is not None and known[0] is sample:
            return known[1]
        time_ns = self._time(sample.time_s)
        data = sample_message(self._signals[sample.signal], sample, time_ns, self._prefix)
        message = TopicMessage(time_ns, data)
        self._newest[sample.signal] = sample, message
        return message

    def of_tree(self, sample: Sample) -> TopicMessage | None:
        """Return the message with the transforms of a tree; None for a tree without transforms."""
        known = self._newest_trees.get(sample.signal)
        if known is not None and known[0] is sample:
            return known[1]
        time_ns = self._time(sample.time_s)
        data = transforms_message(sample.value, time_ns, self._prefix)
        message = None if data is None else TopicMessage(time_ns, data)
        self._newest_trees[sample.signal] = sample, message
        return message

    def of_note(self, note: LogEntry) -> TopicMessage:
        """Return the message for a log entry."""
        time_ns = self._time(note.time_s)
        return TopicMessage(time_ns, log_message(note, time_ns))

    def of_link(self, status: LinkStatus) -> TopicMessage:
        """Return the message for the state of a connection."""
        return TopicMessage(self._time(status.since_s), link_message(status))

    def _time(self, time_s: float) -> int:
        return min(max(self._utc_ns(time_s), 0), _LAST_NS)
