"""The held commands of a robot, and the interfaces that the motion controller needs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from urc.model.driver import Command, Driver
from urc.model.exchange import Hold
from urc.model.payload import CountedFrame, FrameVariants, Payload
from urc.model.values import Reading
from urc.motion.hold_to_run import HoldTerms, Reason
from urc.motion.slew_rate import SlewRateLimiter
from urc.motion.stall import STALLED_S
from urc.protocol.events import MotionEvent

__all__ = [
    "HeldControl",
    "MotionFrames",
    "MotionSession",
    "MotionBackend",
    "control_of",
    "is_lossy",
    "period_of",
]


class MotionFrames(Protocol):
    """The controller's interface to the engine: `urc.protocol.motion_encoder.MotionEncoder`."""

    def is_lasting(self, command: str) -> bool:
        """Return whether the stop frame of a held command never changes."""

    def has_stops(self, command: str) -> bool:
        """Return whether the last rendered stop frames are enough for now."""

    def is_ready(self, command: str) -> bool:
        """Return whether its transport is connected, and the steps are done."""

    def stop_frame(self, command: str) -> Payload | FrameVariants:
        """Return the stop frame of a held command; raise `UrcError` on failure."""

    def motion_frame(
        self, command: str, arguments: Mapping[str, Reading], now: float
    ) -> Payload | CountedFrame:
        """Return the frame of a held command; raise `UrcError` with the reason of a refusal."""


class MotionBackend(Protocol):
    """The controller's interface to the writer of motion: the guard process, or this one."""

    def arm(self, command: str, terms: HoldTerms) -> None:
        """Accept ticks of `command` from now on, under these terms."""

    def tick(self, command: str, data: Payload | CountedFrame) -> None:
        """Renew the lease of `command`; `data` is its newest frame."""

    def renew(self, command: str, stop: Payload | FrameVariants) -> None:
        """Replace the stop frame of `command`; this arms nothing."""

    def is_stopping(self, command: str) -> bool:
        """Return whether `command` may be moving, or its stop may be repeated."""

    def is_open(self, command: str) -> bool:
        """Return whether its transport is connected, by the last report."""

    def release(self, command: str) -> None:
        """Stop `command` after its release."""

    def stop(self, stops: Mapping[str, Payload | FrameVariants]) -> None:
        """Stop all motion at once, with these stop frames of all held commands."""

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        """Wait for the next written stop frames; return command and reason of each.

        The list is in order, and has at least one entry. A cancellation loses none. A control that
        `stop` stopped is reported as ``stopped`` even without motion, because its transport has
        accepted the stop.
        """


class MotionSession(Protocol):
    """The part of a session that a motion controller needs."""

    on_motion: Callable[[MotionEvent], None] | None
    """Callback for the engine's events of held commands; set by the motion controller."""

    @property
    def frames(self) -> MotionFrames:
        """The engine."""

    @property
    def backend(self) -> MotionBackend | None:
        """The guard; None for a robot without held commands."""


@dataclass(slots=True)
class HeldControl:
    """One held command, from its page's point of view."""

    line: str
    hold: Hold
    period_s: float
    """Shortest time between two of its frames, in seconds."""
    slew: SlewRateLimiter | None
    defaults: Mapping[str, Reading]
    """Defaults of the arguments that slew limits."""
    needs_ready_line: bool
    """Whether a stop that was sent before its transport was ready is repeated."""
    is_armed: bool = False
    is_lasting: bool = False
    """Whether its stop frame stays the same while it is armed."""
    motion_state: Literal["rest", "moving", "ending"] = "rest"
    """``ending``: released, and its stop is not reported as written yet."""
    stop: Payload | FrameVariants | None = None
    """Stop frame of the command, as stored by the motion backend."""
    is_owed_again: bool = False
    """Whether its stop was sent before the transport was ready, and must be repeated."""
    needs_release: bool = False
    why: str = ""
    """Reason for which it needs a release."""
    closed_epoch: int = -1
    """Epoch of the lease in which it was stopped; it continues only in a later one."""

    def rest(self) -> None:
        """Set the control to rest."""
        if self.slew is not None:
            self.slew.reset()

    def close(self, why: str, epoch: int) -> None:
        """Accept no tick before a release and a new lease after `epoch`.

        The first reason stays, because later ones follow from it.
        """
        if not self.needs_release:
            self.why = why
        self.rest()
        self.motion_state = "rest"
        self.is_armed = False
        self.needs_release = True
        self.closed_epoch = epoch

    def limited(self, arguments: Mapping[str, Reading], now: float) -> Mapping[str, Reading]:
        """Return the arguments after the slew rate limit."""
        if self.slew is None:
            return arguments
        return self.slew.limit({**self.defaults, **arguments}, now)


def control_of(driver: Driver, command: Command) -> HeldControl:
    """Return a held command of `driver`, at rest."""
    hold = command.hold
    assert hold is not None  # noqa: S101 - callers pass only held commands
    slew, defaults = None, {}
    if hold.slew:
        arguments = command.arguments
        defaults = {name: arguments[name].default for name in hold.slew if name in arguments}
        rest = {name: one.default for name, one in command.arguments.items()} | dict(hold.release)
        slew = SlewRateLimiter(hold.slew, rest, hold.repeat_s)
    line = driver.transports[command.transport]
    # Before its start-up steps, a robot may take a stop for a part of its login. On a half-duplex
    # line, the stop may collide with an answer that the robot still sends.
    needs_ready_line = bool(line.on_connect) or line.is_half_duplex
    period_s = period_of(driver, command)
    return HeldControl(command.transport, hold, period_s, slew, defaults, needs_ready_line)


def period_of(driver: Driver, command: Command) -> float:
    """Return the shortest allowed time between two frames of a held command, in seconds."""
    hold = command.hold
    repeat_s = STALLED_S if hold is None else hold.repeat_s
    rate_s = 1 / command.rate_per_s if command.rate_per_s else 0.0
    is_realtime = command.priority == "realtime"
    gap_s = 0.0 if is_realtime else driver.transports[command.transport].min_gap_s
    return max(repeat_s, rate_s, gap_s)


_LOSSY = frozenset(("udp", "serial", "mqtt", "ros"))
"""Transports on which one stop may be lost."""


def is_lossy(driver: Driver, transport: str) -> bool:
    """Return whether written data may be lost on this transport without notice."""
    return driver.transports[transport].type in _LOSSY
