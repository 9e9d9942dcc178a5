"""Request handling: queues, reply stages and conditions.

This module contains only data classes. `urc.config` creates instances of these classes, and
`urc.protocol` uses the instances.
"""

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

from urc.expressions import Template
from urc.model.payload import ReadSpec, WriteSpec
from urc.model.values import NOTHING, Reading
from urc.patterns import Pattern

__all__ = [
    "MOST_STOPS",
    "RESENDS",
    "ProvisionalReplies",
    "Confirm",
    "ErrorReply",
    "Hold",
    "Keepalive",
    "Offline",
    "Priority",
    "Queue",
    "Requirement",
    "Retry",
    "Sight",
    "Stage",
    "Verify",
]

RESENDS = 3
"""Default number of retransmissions at the robot's request, for commands without ``retries``."""

Priority = Literal["realtime", "high", "normal", "low"]
"""Priority of a request. ``realtime`` requests ignore the queue, the minimum gap and pending
replies."""


class Queue(NamedTuple):
    """Limits of one connection's request queue."""

    in_flight: int = 1
    """Maximum number of requests in flight at the same time, 1 to 64."""
    depth: int = 64
    """Maximum number of queued requests; further requests are refused."""
    most_bytes: int | None = None
    """Maximum number of unacknowledged request bytes, including framing; None means unlimited."""


class Keepalive(NamedTuple):
    """A frame that keeps an idle connection open."""

    every_s: float
    """Maximum time without sending a frame, in seconds."""
    run: str = ""
    """Command to run; "" when `send` declares the frame."""
    send: WriteSpec | None = None
    watchdog_s: float | None = None
    """The robot's watchdog timeout as specified by its manufacturer, in seconds. After a watchdog
    timeout, the robot closes the connection or stops."""
    after: tuple[str, ...] = ()
    """Commands that reset the robot's watchdog; () means that every frame resets it."""


class ErrorReply(NamedTuple):
    """A declared reply that reports a failure."""

    read: ReadSpec
    text: Template | None = None
    """Template for the message to the operator, using the reply fields; None means the raw
    reply."""


class ProvisionalReplies(NamedTuple):
    """Provisional replies that may arrive before the final reply to a request."""

    resend: ReadSpec | None = None
    """Frame that requests a retransmission; None means not supported."""
    extend: ReadSpec | None = None
    """Frame that reports that the robot is busy and extends the timeout; None means not
    supported."""
    extend_s: float = 600.0
    """Maximum total extension of the timeout by `extend` frames, in seconds, 0.001 to 3600."""


class Stage(NamedTuple):
    """A reply that follows the first reply to a request."""

    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    faults: tuple[ErrorReply, ...] = ()
    timeout_s: float | None = None
    """Reply timeout, in seconds; None means the transport's ``timeouts.reply``."""
    asides: ProvisionalReplies = ProvisionalReplies()


MOST_STOPS: Final = 11
"""Maximum number of times that one stop is sent on a transport that may lose frames."""


class Sight(NamedTuple):
    """The image that the operator must see to drive, and the limits of its age."""

    signal: str
    """Signal of type ``image`` or ``video``."""
    stop_after_s: float
    """Age of the image at which the motion ends, 0.2 to 5 s."""
    slow_after_s: float | None = None
    """Age of the image at which the permitted speed begins to fall, in seconds. None means that the
    speed stays the same up to `stop_after_s`."""


class Hold(NamedTuple):
    """A command that moves the robot only while the operator holds the control."""

    repeat_s: float
    """Interval between two setpoints while the control is held, in seconds."""
    release: Mapping[str, Reading] = NOTHING
    """Arguments that stop the motion; omitted arguments have their default values."""
    lease_s: float = 0.25
    """Duration of the motion lease if the operator does not renew it, 0.1 to 1.0 s."""
    watchdog_s: float | None = None
    """The robot's watchdog timeout, in seconds: motion continues for this time after the last
    setpoint. ``inf`` means that the robot has no watchdog; None means that the watchdog is unknown.
    Only the loader's rules use the watchdog timeout."""
    slew: Mapping[str, float] = NOTHING
    """Maximum change per second away from the stop value, keyed by argument."""
    on_stall: Literal["abort", "wait"] | None = None
    """Reaction to a stalled connection during motion; None means the transport's default."""
    step_s: float | None = None
    """Maximum duration of one motion step, in seconds, if the robot ends each step without a stop.
    None means that the robot moves until a stop arrives."""
    sight: Sight | None = None
    """The image that the operator must see; None if the motion needs no image."""


class Confirm(NamedTuple):
    """A confirmation question that is asked before a command is sent."""

    level: Literal["normal", "hazardous"] = "normal"
    text: str = ""
    is_two_person: bool = False
    """Whether the engine requires the name of a second person (two-person rule)."""


class Retry(NamedTuple):
    """Delays before retries of a request, doubling from `initial_s` to `max_s`, in seconds."""

    initial_s: float = 0.0
    max_s: float = 0.0

    def wait_s(self, tries: int) -> float:
        """Return the delay in seconds after `tries` unanswered requests; `tries` is at least 1."""
        return min(self.initial_s * 2.0 ** min(tries - 1, 32), self.max_s)


class Requirement(NamedTuple):
    """An interlock: a condition for sending a command."""

    condition: Template
    """Condition on fresh signals, settings and the command's arguments."""
    text: str
    """Message for the operator when the condition is false."""


class Verify(NamedTuple):
    """A condition that confirms the effect of a command."""

    condition: Template
    """Condition on settings, arguments, and signals received after the command."""
    within_s: float


class Offline(NamedTuple):
    """Slower polling of a robot, or a device of the robot, that no longer replies."""

    after: int
    """Number of consecutive missed replies before the robot is offline."""
    retry_s: float
    """Poll period while the robot is offline, in seconds."""
