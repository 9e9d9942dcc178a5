"""How talk flows: queues, stages of a reply, and conditions.

Everything here is data, made by `urc.config` and acted upon by `urc.protocol`.
"""

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple

from urc.expressions import Template
from urc.model.codec import ReadSpec, WriteSpec
from urc.model.values import NOTHING, Reading
from urc.patterns import Pattern

__all__ = [
    "MOST_STOPS",
    "RESENDS",
    "Asides",
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
"""How often a frame is sent again for a robot that asks, where ``retries`` does not say it."""

Priority = Literal["realtime", "high", "normal", "low"]
"""``realtime`` waits for nothing: neither for the queue, nor for the gap, nor for an answer."""


class Queue(NamedTuple):
    """What may wait on one line."""

    in_flight: int = 1
    """Requests that may wait for their answer at a time, 1 to 64."""
    depth: int = 64
    """Requests that may wait to be sent; one more is refused."""
    most_bytes: int | None = None
    """Bytes of requests that wait for their answers, framing included; None: any number."""


class Keepalive(NamedTuple):
    """What is said when nothing else has been said for a while."""

    every_s: float
    """How long the line may be without anything sent, in seconds."""
    run: str = ""
    """Command to run; "" when `send` says it."""
    send: WriteSpec | None = None
    watchdog_s: float | None = None
    """After how long without a word the robot hangs up or stops, as its maker says."""
    after: tuple[str, ...] = ()
    """Commands that the robot counts as a word; () for all that is sent."""


class ErrorReply(NamedTuple):
    """An answer that means failure, read by any form."""

    read: ReadSpec
    text: Template | None = None
    """What to tell people, over the answer's fields; None: the answer as it came."""


class Asides(NamedTuple):
    """What a robot may say about a request before it answers."""

    resend: ReadSpec | None = None
    """A frame by which it asks for the request again; None: it never does."""
    extend: ReadSpec | None = None
    """A frame by which it says that it is busy; None: it never does."""
    extend_s: float = 600.0
    """How long it may be busy in all, in seconds, 0.001 to 3600."""


class Stage(NamedTuple):
    """A further answer to a request, after the first one."""

    read: ReadSpec
    errors: tuple[Pattern, ...] = ()
    faults: tuple[ErrorReply, ...] = ()
    timeout_s: float | None = None
    """None: the transport's ``timeouts.reply``."""
    asides: Asides = Asides()


MOST_STOPS: Final = 11
"""How often the stop of one motion is sent at most: where it may be lost, it is repeated."""


class Hold(NamedTuple):
    """A command that means motion for as long as it is held."""

    repeat_s: float
    """How often the newest values are sent, in seconds."""
    release: Mapping[str, Reading] = NOTHING
    """Arguments that stop the motion; those left out take their defaults."""
    lease_s: float = 0.25
    """How long the motion lasts when nothing is heard from whoever holds it: 0.1 to 1.0 s."""
    watchdog_s: float | None = None
    """How long the robot itself goes on after the last value, ``inf`` when it never stops by
    itself; None: nobody has said. For the loader's rules alone."""
    slew: Mapping[str, float] = NOTHING
    """Argument → most that it may grow in a second, away from the value that stops the motion."""
    on_stall: Literal["abort", "wait"] | None = None
    """What becomes of a line that takes nothing while it moves; None: as is usual on its kind."""
    step_s: float | None = None
    """How long a step takes at most, after which the robot stops by itself: nothing is sent to stop
    it. None: it moves until it is stopped."""


class Confirm(NamedTuple):
    """A question before the command is sent."""

    level: Literal["normal", "hazardous"] = "normal"
    text: str = ""
    is_two_person: bool = False
    """One person alone may not say yes: the engine refuses without a second name."""


class Retry(NamedTuple):
    """Waits before a request is sent again, doubling from `initial_s` to `max_s`, in seconds."""

    initial_s: float = 0.0
    max_s: float = 0.0

    def wait_s(self, tries: int) -> float:
        """Return the wait after `tries` unanswered ones, 1 or more."""
        return min(self.initial_s * 2.0 ** min(tries - 1, 32), self.max_s)


class Requirement(NamedTuple):
    """What must hold for a command to be sent."""

    condition: Template
    """Over fresh signals, settings and the command's arguments."""
    text: str
    """What to tell people where it does not hold."""


class Verify(NamedTuple):
    """What must come true for a command to count as done."""

    condition: Template
    """Over settings, the command's arguments, and signals read after it was sent."""
    within_s: float


class Offline(NamedTuple):
    """How a poll treats a robot, or a part of it, that does not answer."""

    after: int
    """Misses in a row."""
    retry_s: float
    """Period from then on, until it answers; in seconds."""
