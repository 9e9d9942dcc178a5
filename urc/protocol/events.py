"""Input and output events of an engine: its only interface to the outside."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

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
    "NumbersUsed",
    "Open",
    "Ready",
    "Replied",
    "Request",
    "Samples",
    "Send",
]


class Request(NamedTuple):
    """One command to run. Exactly one `Replied` or `Failed` answers each request."""

    id: int
    command: str
    arguments: Mapping[str, Reading] = NOTHING
    confirmed_by: tuple[str, ...] = ()
    """People who have confirmed the command, including the person who requested it."""
    on_sent: Callable[[Payload], None] | None = None
    """Callback for each sent payload, except secret ones and those of sequences."""


class Open(NamedTuple):
    """Connect this transport for a waiting request (``connection: per_request``)."""

    transport: str


class Send(NamedTuple):
    """Send these bytes, framing included, or this envelope."""

    transport: str
    data: Payload
    is_secret: bool = False
    """Whether its text must not be shown or logged."""
    counted: CountedFrame | None = None
    """The same frame with its counters, on a connection that the guard shares."""


class Close(NamedTuple):
    """Close this transport; the engine has discarded its connection."""

    transport: str
    reason: str = ""
    """Reason of a failure; "" for the normal end of a per-request connection."""


class Ready(NamedTuple):
    """The login has succeeded: all requests may be sent."""

    transport: str


class Samples(NamedTuple):
    """Samples of frames received together, in order, each with its computed signals."""

    transport: str
    """Name of the transport; "" when an alarm began without a frame."""
    samples: tuple[Sample, ...]


class Replied(NamedTuple):
    """The request has succeeded. `values` are the fields of the reply by name."""

    id: int
    command: str
    values: Mapping[str, Reading] = NOTHING


class Failed(NamedTuple):
    """The request has ended without success."""

    id: int
    command: str
    code: str
    """``timed-out``, ``refused``, ``disconnected``, ``bad-argument``, ``queue-full``, ``at-work``,
    ``unknown-command``, ``superseded``, ``not-allowed``, ``not-confirmed``,
    ``not-verified``, ``failed``."""
    message: str


class Violation(NamedTuple):
    """A protocol violation on the wire: counted and shown, never raised."""

    transport: str
    code: str
    """``frame-too-long``, ``no-match``, ``bad-value``, ``bad-text``, ``cut-frame``,
    ``reply-timeout``, ``late-reply``, ``refused``, ``bad-argument``, ``silent``, ``failed``."""
    message: str


class NumbersUsed(NamedTuple):
    """Counters of this line advanced: the stop frames rendered so far have used numbers.

    The event occurs only on lines whose counters are shared with motion (`MotionEncoder.share`).
    """

    transport: str


class MotionReady(NamedTuple):
    """This line of held commands is connected, and its start-up steps are done."""

    transport: str


class MotionRefused(NamedTuple):
    """The robot refuses a held command."""

    transport: str
    command: str
    why: str


MotionEvent = NumbersUsed | MotionReady | MotionRefused
"""Events for the controller of held commands."""
Event = Open | Send | Close | Ready | Samples | Replied | Failed | Violation | MotionEvent
