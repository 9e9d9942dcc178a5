"""Checks that a driver's topics match the graph of a ROS system.

A ROS connection reports no error for a topic that does not exist, has a different type, or has no
subscribers. A connection with access to the graph, such as rosapi, passes the topics to a
`TopicGraph`. The `TopicGraph` reports each mistake once. No I/O.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Final

from urc.transports.ros.topic_list import short_type

__all__ = ["TopicGraph", "version_of"]

MAX_TOLD: Final = 256
"""Maximum number of remembered reports; further mistakes are not reported."""


class TopicGraph:
    """The topics of one ROS system and the mistakes reported so far."""

    def __init__(self, tell: Callable[[str], None], ros: int | None) -> None:
        """Initialise an empty graph.

        Args:
            tell: callback that receives one line for each mistake.
            ros: ROS version declared in the document; None if undeclared.
        """
        self._tell = tell
        self._declared = ros
        self._types: Mapping[str, str] = {}
        self._told: set[str] = set()
        self._looked: set[str] = set()

    def learn(self, types: Mapping[str, str]) -> None:
        """Set the existing topics and their types; a type is "" if unknown."""
        self._types = types
        self._looked.clear()
        found = version_of(types.values())
        if self._declared is not None and found not in (None, self._declared):
            self._log(f"this bridge is ROS {found}: write 'version: {found}' or 'version: auto'")

    def subscribed(self, wanted: Mapping[str, str]) -> None:
        """Report each subscribed topic that does not exist or has a different type."""
        for topic, kind in sorted(wanted.items()):
            # In ROS 2, the feedback of an action is not an ordinary topic.
            if topic not in self._types and not topic.endswith("/feedback"):
                self._log(f"nothing publishes {topic}")
            else:
                self._compare(topic, kind, "carries")

    def publishes(self, topic: str, kind: str) -> bool:
        """Check a published topic's type; return whether to query the topic's subscribers."""
        if topic in self._looked:
            return False
        self._looked.add(topic)
        self._compare(topic, kind, "takes")
        return True

    def subscribers(self, topic: str, nodes: Iterable[object]) -> None:
        """Report a published topic that has no subscribers."""
        if not list(nodes):
            self._log(f"nothing subscribes to {topic}: its messages have no effect")

    def _compare(self, topic: str, kind: str, verb: str) -> None:
        known = self._types.get(topic, "")
        if known and kind and short_type(known) != short_type(kind):
            self._log(f"{topic} {verb} {short_type(known)}, not {short_type(kind)}")

    def _log(self, text: str) -> None:
        if text not in self._told and len(self._told) < MAX_TOLD:
            self._told.add(text)
            self._tell(text)


def version_of(types: Iterable[str]) -> int | None:
    """Return the ROS version (1 or 2) whose form most type names have; None without names.

    A bridge may also list the topics that URC itself has named, in the form of the driver.
    """
    words = [len(name.split("/")) for name in types if name]
    if not words:
        return None
    return 2 if 2 * words.count(3) >= len(words) else 1
