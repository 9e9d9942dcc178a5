"""Comparison of a driver's ROS topics with the topics that the robot reports.

Layer 4. Pure. A mismatch exists only for what the connection reports. Where the connection does not
know the nodes or the types of a topic, there is no mismatch.
"""

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

from urc.model.driver import Driver
from urc.model.values import Value
from urc.problems import UrcError
from urc.protocol.forms.topics import namespace_of, published, topic_of
from urc.transports.ros.topic_list import TopicList, TopicRow, short_type

__all__ = ["TopicMismatch", "TopicUse", "find_mismatches", "topic_uses"]

MismatchCode = Literal["no-subscriber", "no-publisher", "takes-type", "carries-type", "ros-version"]
_NOT_LISTED: Final = ("/feedback", "parameter:")
"""End of an action's feedback topic, which ROS 2 does not list, and beginning of a parameter."""


class TopicUse(NamedTuple):
    """One topic that the driver uses on one transport."""

    transport: str
    topic: str
    type: str
    """Declared type; "" if undeclared."""
    is_published: bool
    names: tuple[str, ...]
    """The commands that publish the topic, or the signals that its messages set."""


class TopicMismatch(NamedTuple):
    """One difference between the driver and the robot."""

    code: MismatchCode
    use: TopicUse
    found: str = ""
    """Type or ROS version of the robot."""
    wanted: str = ""
    """Type or ROS version of the driver."""


def topic_uses(driver: Driver, settings: Mapping[str, Value]) -> list[TopicUse]:
    """Return the topics that a driver uses on its ROS connections; see `published`."""
    lines = [name for name, spec in driver.transports.items() if spec.type == "ros"]
    found: dict[tuple[str, str, str, bool], dict[str, None]] = {}
    for message in driver.messages.values():
        if message.transport in lines and message.read.topic is not None:
            try:
                namespace = namespace_of(driver.transports[message.transport], settings)
                topic = topic_of(message.read, settings, namespace)
            except UrcError:
                continue
            kind = str(message.read.listen.get("type") or "")
            names = [name for name in message.read.fields if name in driver.signals]
            key = (message.transport, topic, kind, False)
            found.setdefault(key, {}).update(dict.fromkeys(names))
    for line in lines:
        for name, topic, kind in published(driver, line, settings):
            found.setdefault((line, topic, kind, True), {})[name] = None
    return [TopicUse(*key, tuple(names)) for key, names in found.items() if key[1]]


def find_mismatches(
    uses: list[TopicUse], lists: Mapping[str, TopicList], versions: Mapping[str, object]
) -> list[TopicMismatch]:
    """Return the differences between a driver and its robot, at most one for each use of a topic.

    Args:
        uses: the driver's topics.
        lists: the topics of each transport that has reported its topics, keyed by transport.
        versions: declared ROS version of each transport, keyed by transport.
    """
    rows = {(name, row.name): row for name, one in lists.items() for row in one.rows}
    mismatches = []
    for use in uses:
        listed = lists.get(use.transport)
        row = rows.get((use.transport, use.topic))
        if listed is None or row is None or not listed.is_known:
            continue
        declared = versions.get(use.transport)
        if declared in (1, 2) and listed.version not in (None, declared):
            version = TopicMismatch("ros-version", use, str(listed.version), str(declared))
            mismatches.append(version)
        elif (mismatch := _mismatch(use, row)) is not None:
            mismatches.append(mismatch)
    return mismatches


def _mismatch(use: TopicUse, row: TopicRow) -> TopicMismatch | None:
    nodes, types = (
        (row.subscribers, row.takes) if use.is_published else (row.publishers, row.carries)
    )
    if nodes == ():
        if use.topic.endswith(_NOT_LISTED[0]) or use.topic.startswith(_NOT_LISTED[1]):
            return None
        return TopicMismatch("no-subscriber" if use.is_published else "no-publisher", use)
    wanted, found = short_type(use.type), [short_type(kind) for kind in types or ()]
    if not use.type or not found or wanted in found:
        return None
    return TopicMismatch(
        "takes-type" if use.is_published else "carries-type", use, found[0], wanted
    )
