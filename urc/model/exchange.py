"""Flow of requests: queues, stages of a reply, and conditions.

Data only: `urc.config` makes these values, and `urc.protocol` acts on them.
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
    "Stage",
    "Verify",
]

RESENDS = 3
"""Default number of retransmissions for a robot that asks, without ``retries``."""

Priority = Literal["realtime", "high", "normal", "low"]
"""``realtime`` bypasses the queue, the gap between requests, and outstanding replies."""


class Queue(NamedTuple):
    """Limits of the request queue of one connection."""

    in_flight: int = 1
    """Largest number of requests in flight at the same time, 1 to 64."""
    depth: int = 64
    """Largest number of queued requests; a further one is refused."""
    most_bytes: int | None = None
    """Largest number of unacknowledged request bytes, framing included; None: unlimited."""


class Keepalive(NamedTuple):
    """A frame that is sent when the connection has been idle for a while."""

    every_s: float
    """Longest time without a sent frame, in seconds."""
    run: str = ""
    """Command to run; "" when `send` declares the frame."""
    send: WriteSpec | None = None
    watchdog_s: float | None = None
    """Watchdog of the robot, in seconds: silence after which it closes the connection or stops,
    according to its manufacturer."""
    after: tuple[str, ...] = ()
    """Commands that reset the watchdog of the robot; () for all frames."""


class ErrorReply(NamedTuple):
    """A reply that reports a failure, read by any form."""

    read: ReadSpec
    text: Template | None = None
    """Text for the operator, over the fields of the reply; None: the reply as received."""


class ProvisionalReplies(NamedTuple):
    """Provisional replies that may precede the reply to a request."""

    resend: ReadSpec | None = None
    """Frame that asks for a retransmission; None: not supported."""
    extend: ReadSpec | None = None
    """Frame that reports a busy robot and extends the timeout; None: not supported."""
    extend_s: float = 600.0
    """Longest total extension, in seconds, 0.001 to 3600."""


class Stage(NamedTuple):
    """A further reply to a request, after the first one."""

    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    faults: tuple[ErrorReply, ...] = ()
    timeout_s: float | None = None
    """Reply timeout, in seconds; None: ``timeouts.reply`` of the transport."""
    asides: ProvisionalReplies = ProvisionalReplies()


MOST_STOPS: Final = 11
"""Largest number of transmissions of a stop; on a lossy transport, the stop is repeated."""


class Hold(NamedTuple):
    """A command that moves the robot only while its control is held."""

    repeat_s: float
    """Period of the setpoints, in seconds."""
    release: Mapping[str, Reading] = NOTHING
    """Arguments that stop the motion; omitted ones take their defaults."""
    lease_s: float = 0.25
    """Lease of the motion without a renewal by the operator, 0.1 to 1.0 s."""
    watchdog_s: float | None = None
    """Watchdog of the robot, in seconds: motion continues this long after the last value. The value
    ``inf`` means without end, and None unknown. Only the rules of the loader read the value."""
    slew: Mapping[str, float] = NOTHING
    """Argument → largest increase per second, away from the value that stops the motion."""
    on_stall: Literal["abort", "wait"] | None = None
    """Reaction to a connection that stalls during motion; None: the default of its transport."""
    step_s: float | None = None
    """Longest duration of a step, in seconds. The robot then stops by itself, so no stop is sent.
    Without a duration, the robot moves until it is stopped."""


class Confirm(NamedTuple):
    """A confirmation question before the command is sent."""

    level: Literal["normal", "hazardous"] = "normal"
    text: str = ""
    is_two_person: bool = False
    """Whether the two-person rule applies: the engine refuses the command without a second name."""


class Retry(NamedTuple):
    """Waits before a request is sent again, doubling from `initial_s` to `max_s`, in seconds."""

    initial_s: float = 0.0
    max_s: float = 0.0

    def wait_s(self, tries: int) -> float:
        """Return the wait after `tries` unanswered requests, 1 or more, in seconds."""
        return min(self.initial_s * 2.0 ** min(tries - 1, 32), self.max_s)


class Requirement(NamedTuple):
    """A precondition for sending a command."""

    condition: Template
    """Condition over fresh signals, settings and the arguments of the command."""
    text: str
    """Text for the operator when the condition is false."""


class Verify(NamedTuple):
    """A condition that confirms the effect of a command."""

    condition: Template
    """Condition over settings, the arguments, and signals that were read after the command."""
    within_s: float


class Offline(NamedTuple):
    """Polling of a robot, or of a part of it, that does not reply."""

    after: int
    """Number of missed replies in a row."""
    retry_s: float
    """Poll period until the next reply, in seconds."""
