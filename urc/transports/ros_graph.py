"""What a ROS system says of its topics, and how the use of a topic can be wrong.

A ROS line answers nothing when a topic does not exist, has another type, or has no subscriber: all
of that is silence. A line that can ask (rosapi, for one) tells its `TopicGraph` the answers, and
the graph puts each fault in one line, once. No input or output.
"""

from collections.abc import Callable, Iterable, Mapping
from typing import Final

__all__ = ["TopicGraph", "version_of"]

MAX_TOLD: Final = 256
"""Faults that are remembered as told; beyond that none is told any more."""


class TopicGraph:
    """Topics of one ROS system, and what was told of them."""

    def __init__(self, tell: Callable[[str], None], ros: int | None) -> None:
        """Know nothing yet.

        Args:
            tell: has one line for each fault.
            ros: the version that the document names; None where it names none.
        """
        self._tell = tell
        self._declared = ros
        self._types: Mapping[str, str] = {}
        self._told: set[str] = set()
        self._looked: set[str] = set()

    def learn(self, types: Mapping[str, str]) -> None:
        """Take the topics that there are, each with its type ("" where it is not known)."""
        self._types = types
        self._looked.clear()
        found = version_of(types.values())
        if self._declared is not None and found not in (None, self._declared):
            self._say(f"this bridge is ROS {found}: write 'ros: {found}' or 'ros: auto'")

    def subscribed(self, wanted: Mapping[str, str]) -> None:
        """Compare what is subscribed to, each topic with its type, with what there is."""
        for topic, kind in sorted(wanted.items()):
            # In ROS 2 the feedback of an action is no topic of its own.
            if topic not in self._types and not topic.endswith("/feedback"):
                self._say(f"nobody publishes {topic}")
            else:
                self._compare(topic, kind, "carries")

    def publishes(self, topic: str, kind: str) -> bool:
        """Compare the type of what is published; return whether to ask who subscribes."""
        if topic in self._looked:
            return False
        self._looked.add(topic)
        self._compare(topic, kind, "takes")
        return True

    def subscribers(self, topic: str, nodes: Iterable[object]) -> None:
        """Take the nodes that subscribe to a topic on which something is published."""
        if not list(nodes):
            self._say(f"nothing subscribes to {topic}: what is sent there moves nothing")

    def _compare(self, topic: str, kind: str, verb: str) -> None:
        known = self._types.get(topic, "")
        if known and kind and _plain(known) != _plain(kind):
            self._say(f"{topic} {verb} {_plain(known)}, not {_plain(kind)}")

    def _say(self, text: str) -> None:
        if text not in self._told and len(self._told) < MAX_TOLD:
            self._told.add(text)
            self._tell(text)


def version_of(types: Iterable[str]) -> int | None:
    """Return the version of ROS that spells these names of types; None where none tells."""
    words = [len(name.split("/")) for name in types if name]
    if not words:
        return None
    return 2 if 3 in words else 1


def _plain(kind: str) -> str:
    """Return ``pkg/Type`` of a type, however it is spelled."""
    words = kind.split("/")
    return f"{words[0]}/{words[-1]}"
