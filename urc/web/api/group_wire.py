"""JSON messages of the HTTP API for commands to several robots; the keys are in snake case.

Layer 5. Pure.
"""

from typing import Annotated, Any

import msgspec

from urc.web.api.wire import LONGEST_TIMEOUT_S, ApiMessage
from urc.wire.client_messages import Arguments

__all__ = ["GroupAnswer", "GroupAsked", "RobotReply"]

_Word = Annotated[str, msgspec.Meta(max_length=200)]
_Words = Annotated[tuple[_Word, ...], msgspec.Meta(max_length=1000)]


class GroupAsked(ApiMessage, frozen=True):
    """A command to several robots: named robots, and robots with a tag."""

    command: _Word
    robots: _Words = ()
    """Names of robots in URLs."""
    tags: _Words = ()
    """Tags; each robot with at least one of these tags and with the command is chosen."""
    arguments: Arguments = msgspec.field(default_factory=dict)
    """Argument values, keyed by argument; an omitted argument takes its default."""
    timeout_s: Annotated[float, msgspec.Meta(ge=0.01, le=LONGEST_TIMEOUT_S)] | None = None
    """Longest wait for each reply, in seconds; null means 30, or 600 for a sequence."""
    confirmed: bool = False
    """Whether a person has confirmed the command for this number of robots."""


class RobotReply(ApiMessage, frozen=True):
    """The result of the command for one robot."""

    name: str
    """The robot's name in URLs."""
    title: str
    done: bool
    """Whether the robot has run the command."""
    code: str = ""
    """Reason code of a failure, as for a command to one robot; "" if the command is done."""
    message: str = ""
    """Reason of a failure, as one line of text."""
    values: dict[str, Any] = msgspec.field(default_factory=dict)
    """Values of the reply, keyed by field name."""


class GroupAnswer(ApiMessage, frozen=True):
    """The results of the command for all chosen robots."""

    robots: tuple[RobotReply, ...]
