"""JSON messages of the HTTP API for the STOP of several robots; the keys are in snake case.

Layer 5. Pure.
"""

from typing import Annotated, Literal

import msgspec

from urc.web.api.wire import ApiMessage

__all__ = ["RobotStop", "StopAnswer", "StopAsked"]

_Word = Annotated[str, msgspec.Meta(max_length=200)]
_Words = Annotated[tuple[_Word, ...], msgspec.Meta(max_length=5000)]


class StopAsked(ApiMessage, frozen=True):
    """The robots to stop: named robots, robots with a tag, or all robots."""

    robots: _Words = ()
    """Names of robots in URLs."""
    tags: _Words = ()
    """Tags; each robot with at least one of these tags stops."""
    all: bool = False
    """Whether to stop all robots that can move."""


class RobotStop(ApiMessage, frozen=True):
    """The result of STOP for one robot."""

    name: str
    """The robot's name in URLs."""
    title: str
    result: Literal["confirmed", "latched", "no-link", "refused"]
    """``confirmed``: the robot has accepted the stop. ``latched``: STOP is latched, but the driver
    defines no stop to send. ``no-link``: the robot or its site has not confirmed the stop in time;
    URC repeats it. ``refused``: the robot is unknown or has no motion."""
    reason: str = ""
    """Why the stop is not confirmed, as one line of text; "" for a confirmed stop."""


class StopAnswer(ApiMessage, frozen=True):
    """The results of STOP for all requested robots."""

    id: str
    """Identifier of this STOP in the audit logs of all sites."""
    robots: tuple[RobotStop, ...]
    """One result for each robot, in the order of the names."""
    unknown_tags: tuple[str, ...] = ()
    """Requested tags that no robot has."""
