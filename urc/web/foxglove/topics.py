"""A robot's data as Foxglove topics.

Layer 5. Pure. Each signal is a topic. The names of all other topics begin with ``/ROBOT/urc/``,
because a signal may have any name.
"""

import json
from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

from urc.model.driver import Driver
from urc.model.values import Sample, Signal
from urc.runtime.hub import LinkStatus, LogEntry
from urc.runtime.json_messages import (
    LINK_SCHEMA,
    LOG_SCHEMA,
    MessageSchema,
    link_message,
    log_message,
    sample_message,
    signal_schema,
)

__all__ = ["LOG_SOURCE", "HubMessages", "TopicMessage", "RobotTopic", "TopicSource", "robot_topics"]

_LAST_NS = 2**63 - 1


class TopicSource(NamedTuple):
    """The origin of a topic's messages in a robot's hub."""

    kind: Literal["signal", "log", "link"]
    name: str = ""
    """Name of the signal or transport."""


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


def robot_topics(robot: str, driver: Driver) -> tuple[RobotTopic, ...]:
    """Return the topics of a robot, whose name in URLs is `robot`."""
    found = [
        _topic(f"/{robot}/{signal.name}", TopicSource("signal", signal.name), signal_schema(signal))
        for signal in driver.signals.values()
    ]
    found.append(_topic(f"/{robot}/urc/log", LOG_SOURCE, LOG_SCHEMA))
    for name in driver.transports:
        found.append(_topic(f"/{robot}/urc/link/{name}", TopicSource("link", name), LINK_SCHEMA))
    return tuple(found)


def _topic(topic: str, source: TopicSource, shape: MessageSchema) -> RobotTopic:
    return RobotTopic(topic, source, shape.name, json.dumps(shape.schema))


class HubMessages:
    """The messages of one hub; all clients share the newest message of each signal."""

    def __init__(self, signals: Mapping[str, Signal], utc_ns: Callable[[float], int]) -> None:
        """Start without messages.

        Args:
            signals: the driver's signals.
            utc_ns: function that converts seconds on the hub's clock to nanoseconds since 1970.
        """
        self._signals = signals
        self._utc_ns = utc_ns
        self._newest: dict[str, tuple[Sample, TopicMessage]] = {}

    def of_sample(self, sample: Sample) -> TopicMessage:
        """Return the message for a reading."""
        known = self._newest.get(sample.signal)
        if known is not None and known[0] is sample:
            return known[1]
        time_ns = self._time(sample.time_s)
        data = sample_message(self._signals[sample.signal], sample, time_ns)
        message = TopicMessage(time_ns, data)
        self._newest[sample.signal] = sample, message
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
