"""Requests to the engine, and the events that the engine returns to its owner."""

from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

from urc.model.payload import CountedFrame, Payload
from urc.model.values import NOTHING, Reading, Sample

__all__ = [
    "Close",
    "Event",
    "Failed",
    "Violation",
    "MotionEvent",
    "MotionReady",
    "MotionRefused",
    "Noted",
    "NumbersUsed",
    "Open",
    "Ready",
    "Replied",
    "Request",
    "Samples",
    "Send",
]


class Request(NamedTuple):
    """A request to run a command, answered by exactly one `Replied` or `Failed`."""

    id: int
    command: str
    arguments: Mapping[str, Reading] = NOTHING
    confirmed_by: tuple[str, ...] = ()
    """Names of the people who have confirmed the command, including the requester."""
    on_sent: Callable[[Payload], None] | None = None
    """Callback for each sent payload, except secret payloads and sequence payloads."""
    unless: Callable[[], str] | None = None
    """Function that returns why the command may no longer start, or "". It is called when the frame
    leaves URC, because a command may wait in a queue and a goal may wait for its services."""
    on_goal: Callable[[str, bool], None] | None = None
    """Callback for the goals that the command sends. It receives the ROS action, and whether the
    goal has ended. It is called when a goal is sent, and when the goal's end is known."""


class Open(NamedTuple):
    """Open this transport's connection for a waiting request (``connection: per_request``)."""

    transport: str


class Send(NamedTuple):
    """Send framed bytes or an envelope."""

    transport: str
    data: Payload
    is_secret: bool = False
    """Whether `data` contains a secret and must not be shown or logged."""
    counted: CountedFrame | None = None
    """The frame and its counter numbers; None unless the guard also sends on the connection."""


class Close(NamedTuple):
    """Request to close this transport; the engine has already discarded the connection."""

    transport: str
    reason: str = ""
    """Reason for a failure; "" for an orderly close or the end of a per-request connection."""


class Ready(NamedTuple):
    """The login has succeeded, so all requests may be sent."""

    transport: str


class Samples(NamedTuple):
    """The samples of frames that arrived together, in order, including computed signals."""

    transport: str
    """Name of the transport; "" for samples that changed without a frame (a delayed alarm)."""
    samples: tuple[Sample, ...]


class Replied(NamedTuple):
    """The request has succeeded; `values` contains the reply fields, keyed by name."""

    id: int
    command: str
    values: Mapping[str, Reading] = NOTHING


class Failed(NamedTuple):
    """The request has failed."""

    id: int
    command: str
    code: str
    """Failure code: ``timed-out``, ``refused``, ``disconnected``, ``bad-argument``, ``queue-full``,
    ``at-work``, ``unknown-command``, ``superseded``, ``not-allowed``, ``not-confirmed``,
    ``not-verified``, ``stopped``, ``aborted`` or ``failed``."""
    message: str


class Violation(NamedTuple):
    """A protocol violation by the robot; it is counted and shown, but raises no exception."""

    transport: str
    code: str
    """Violation code: the code of a framing violation, or ``no-match``, ``bad-value``,
    ``bad-text``, ``cut-frame``, ``reply-timeout``, ``late-reply``, ``retransmitted``,
    ``motion-refused``, ``refused``, ``bad-argument`` or ``no-data``."""
    message: str


class Noted(NamedTuple):
    """A message that the driver declares as a log entry."""

    transport: str
    level: Literal["info", "warning", "error"]
    text: str


class NumbersUsed(NamedTuple):
    """A frame has used counter numbers, so stop frames rendered earlier may be outdated.

    `NumbersUsed` occurs only on connections that share counters with motion frames
    (`MotionEncoder.share`).
    """

    transport: str


class MotionReady(NamedTuple):
    """A connection for held commands is open, and its login is complete."""

    transport: str


class MotionRefused(NamedTuple):
    """The robot has refused a held command."""

    transport: str
    command: str
    why: str


MotionEvent = NumbersUsed | MotionReady | MotionRefused
"""Events for the motion controller."""
Event = Open | Send | Close | Ready | Samples | Replied | Failed | Violation | Noted | MotionEvent
