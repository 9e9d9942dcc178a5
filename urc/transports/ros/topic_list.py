"""The list of a robot's topics, as each kind of ROS connection reports it.

A request and its answer are envelopes with the verb ``topics``, so that they also reach a transport
in another process. A transport answers only while it publishes nothing, so that a request delays
neither motion nor a stop. The sender repeats unanswered requests. No I/O.
"""

from collections.abc import Iterable, Mapping
from typing import Any, Final, NamedTuple

from urc.model.payload import Envelope
from urc.problems import printable
from urc.transports.base import TOPICS

__all__ = [
    "MAX_TOPICS",
    "QUIET_S",
    "TopicList",
    "TopicRow",
    "answer_of",
    "list_of",
    "request_for",
    "short_type",
    "wanted_of",
]

MAX_TOPICS: Final = 1000
"""Maximum number of topics in an answer; further topics are only counted."""
MAX_WANTED: Final = 64
"""Maximum number of topics that a request may name."""
QUIET_S: Final = 2.0
"""Time without a published message after which a transport answers requests, in seconds."""
_NAME: Final = 256
"""Maximum length of a name, in characters; ROS 2 limits names to 255."""
_NODES: Final = 16
"""Maximum number of reported nodes and types of each topic."""


class TopicRow(NamedTuple):
    """One topic. None stands for what the connection does not report."""

    name: str
    carries: tuple[str, ...] | None = None
    """Types that are published, in the form that the robot uses."""
    takes: tuple[str, ...] | None = None
    """Types that are subscribed to."""
    publishers: tuple[str, ...] | None = None
    """Names of the nodes that publish the topic."""
    subscribers: tuple[str, ...] | None = None
    """Names of the nodes that subscribe to the topic."""
    received: int | None = None
    """Number of messages that URC has received on this connection; None without a subscription."""


class TopicList(NamedTuple):
    """The answer to a request."""

    rows: tuple[TopicRow, ...]
    total: int
    """Number of topics of the robot, including topics without a row."""
    version: int | None
    """ROS version of the robot; None if unknown."""
    is_known: bool
    """Whether the connection can list topics; without rosapi, a rosbridge server cannot."""
    is_all: bool
    """Whether the request was for all topics."""


def request_for(names: Iterable[str], *, is_all: bool) -> Envelope:
    """Return a request for the topics `names`, or for all topics, with `names` first."""
    return Envelope(TOPICS, {"names": list(names)[:MAX_WANTED], "all": is_all})


def wanted_of(request: Envelope) -> tuple[list[str], bool]:
    """Return the names in a request, and whether the request is for all topics."""
    names = request.attributes.get("names")
    wanted = [name for name in names if isinstance(name, str)] if isinstance(names, list) else []
    return wanted[:MAX_WANTED], request.attributes.get("all") is True


def answer_of(
    rows: Iterable[TopicRow],
    total: int,
    version: int | None,
    *,
    is_known: bool = True,
    is_all: bool = False,
) -> Envelope:
    """Return the answer with the given rows; names that are too long for ROS are left out."""
    kept = [_plain(row) for row in rows if len(row.name) <= _NAME][:MAX_TOPICS]
    attributes = {"total": total, "version": version, "known": is_known, "all": is_all}
    return Envelope(TOPICS, attributes, kept)


def _plain(row: TopicRow) -> list[object]:
    """Return a row as lists and text that every encoder accepts."""
    lists = (row.carries, row.takes, row.publishers, row.subscribers)
    shown = [None if one is None else [_text(name) for name in one[:_NODES]] for one in lists]
    return [_text(row.name), *shown, row.received]


def _text(name: str) -> str:
    """Return a name from the robot in a form that can be encoded and displayed."""
    return printable(name[:_NAME].encode("utf-8", "replace").decode())


def list_of(answer: Envelope) -> TopicList:
    """Return the content of an answer that `answer_of` has created."""
    said: Mapping[str, Any] = answer.attributes
    body: Any = answer.body
    rows = tuple(TopicRow._make(map(_tuple, row)) for row in body)
    return TopicList(rows, said["total"], said["version"], said["known"], said["all"])


def _tuple(value: object) -> object:
    return tuple(value) if isinstance(value, list) else value


def short_type(kind: str) -> str:
    """Return a type name in the short form ``pkg/Type``, which ROS 1 and ROS 2 have in common."""
    words = kind.split("/")
    return f"{words[0]}/{words[-1]}" if len(words) > 1 else kind
