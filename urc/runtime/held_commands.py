"""The held commands of a robot, and the interfaces that the motion controller uses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Literal, Protocol

from urc.model.driver import Command, Driver, slowed_arguments
from urc.model.exchange import Hold
from urc.model.payload import CountedFrame, FrameVariants, Payload
from urc.model.values import Reading
from urc.motion.hold_to_run import LATE_STOP_S, STOP_FOR_S, HoldTerms, StopReport
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
    "restored_s",
]


class MotionFrames(Protocol):
    """The interface of `urc.protocol.motion_encoder.MotionEncoder` that the controller uses."""

    def is_lasting(self, command: str) -> bool:
        """Return whether the stop frame of a held command is constant."""

    def has_stops(self, command: str) -> bool:
        """Return whether the rendered stop frames of a held command are still valid."""

    def is_ready(self, command: str) -> bool:
        """Return whether the command's transport is connected and all connection steps are done."""

    def stop_frame(self, command: str) -> Payload | FrameVariants:
        """Return the stop frame of a held command; raise `UrcError` on failure."""

    def motion_frame(
        self, command: str, arguments: Mapping[str, Reading], now: float
    ) -> Payload | CountedFrame:
        """Return the motion frame of a held command; raise `UrcError` if the frame is refused."""


class MotionBackend(Protocol):
    """The interface of the guard that writes motion frames, in this process or its own process."""

    def arm(self, command: str, terms: HoldTerms) -> None:
        """Accept ticks of `command` from now on, with the stop frame and time limits in `terms`."""

    def tick(self, command: str, data: Payload | CountedFrame, for_s: float = inf) -> None:
        """Renew the lease of `command` with its newest frame, for at most `for_s` seconds."""

    def renew(self, command: str, stop: Payload | FrameVariants) -> None:
        """Replace the stop frame of `command` without arming the command."""

    def is_armed(self, command: str) -> bool:
        """Return whether ticks of `command` are accepted; a lost connection disarms the command."""

    def is_stopping(self, command: str) -> bool:
        """Return whether `command` may still move the robot, or its stop may still be repeated."""

    def owes_stop(self, command: str) -> bool:
        """Return whether `command` may still move the robot, because its stop may be unsent."""

    def is_open(self, command: str) -> bool:
        """Return whether the transport of `command` is connected, as last reported."""

    def release(self, command: str) -> None:
        """Stop `command` because its control was released."""

    def stop(self, stops: Mapping[str, Payload | FrameVariants]) -> None:
        """Stop all motion immediately; `stops` maps each held command to its stop frame."""

    async def stops(self) -> Sequence[tuple[str, StopReport]]:
        """Wait until stop frames are written or lost; return a command and a report for each frame.

        The returned list is in order and never empty. If the wait is cancelled, no stop is lost.
        After the transport has accepted the stop frame, a control that was stopped by `stop` is
        reported as ``stopped``, even if it was not moving.
        """


class MotionSession(Protocol):
    """The part of a session that the motion controller uses."""

    on_motion: Callable[[MotionEvent], None] | None
    """Callback for the engine's held-command events; set by the motion controller."""

    @property
    def frames(self) -> MotionFrames:
        """The engine."""

    @property
    def backend(self) -> MotionBackend | None:
        """The motion backend; None if the robot has no held commands."""


@dataclass(slots=True)
class HeldControl:
    """The motion controller's state for one held command."""

    line: str
    hold: Hold
    period_s: float
    """Minimum interval between two frames of the command, in seconds."""
    slew: SlewRateLimiter | None
    defaults: Mapping[str, Reading]
    """Default value of each argument whose slew rate is limited, keyed by argument."""
    needs_ready_line: bool
    """Whether a stop that is sent before the transport is ready must be repeated."""
    rests: Mapping[str, Reading]
    """Value at rest of each argument that an old image or a slow link slows, keyed by argument."""
    short_of: str = ""
    """Message about the image or the link that shortens the lease since the last tick; "" for the
    whole lease."""
    is_armed: bool = False
    is_lasting: bool = False
    """Whether the stop frame stays the same while the command is armed."""
    motion_state: Literal["rest", "moving", "ending"] = "rest"
    """``ending``: the control has been released, but its stop has not yet been reported as
    written."""
    stop: Payload | FrameVariants | None = None
    """Stop frame of the command that was last passed to the motion backend."""
    is_owed_again: bool = False
    """Whether the stop was sent before the transport was ready and must be repeated."""
    needs_release: bool = False
    why: str = ""
    """Reason why the control must be released before new motion; "" if there is no reason."""
    closed_epoch: int = -1
    """Epoch of the lease in which the command was stopped; motion requires a later epoch."""

    def rest(self) -> None:
        """Reset the slew rate limiter, because the control is at rest."""
        if self.slew is not None:
            self.slew.reset()

    def close(self, why: str, epoch: int) -> None:
        """Refuse ticks until the control is released and the lease is newer than `epoch`.

        Only the first reason is stored, because later reasons usually follow from it.
        """
        if not self.needs_release:
            self.why = why
        self.rest()
        self.motion_state = "rest"
        self.is_armed = False
        self.needs_release = True
        self.closed_epoch = epoch

    def limited(self, arguments: Mapping[str, Reading], now: float) -> Mapping[str, Reading]:
        """Return the arguments, with the slew rate limit applied."""
        if self.slew is None:
            return arguments
        return self.slew.limit({**self.defaults, **arguments}, now)


def control_of(driver: Driver, command: Command) -> HeldControl:
    """Return the initial state, at rest, for a held command of `driver`."""
    hold = command.hold
    assert hold is not None  # noqa: S101 - callers pass only held commands
    slew, defaults = None, {}
    if hold.slew:
        arguments = command.arguments
        defaults = {name: arguments[name].default for name in hold.slew if name in arguments}
        rest = {name: one.default for name, one in command.arguments.items()} | dict(hold.release)
        slew = SlewRateLimiter(hold.slew, rest, hold.repeat_s)
    line = driver.transports[command.transport]
    # Before its start-up steps, a robot may mistake a stop for part of its login. On a half-duplex
    # line, the stop may collide with the robot's unfinished answer.
    needs_ready_line = bool(line.on_connect) or line.is_half_duplex
    period_s = period_of(driver, command)
    rests = slowed_arguments(command)
    return HeldControl(command.transport, hold, period_s, slew, defaults, needs_ready_line, rests)


def period_of(driver: Driver, command: Command) -> float:
    """Return the minimum interval between two frames of a held command, in seconds."""
    hold = command.hold
    repeat_s = STALLED_S if hold is None else hold.repeat_s
    rate_s = 1 / command.rate_per_s if command.rate_per_s else 0.0
    is_realtime = command.priority == "realtime"
    gap_s = 0.0 if is_realtime else driver.transports[command.transport].min_gap_s
    return max(repeat_s, rate_s, gap_s)


_LOSSY = frozenset(("udp", "serial", "mqtt", "zenoh", "ros"))
"""Transport types that may lose a single stop frame."""
_BRIDGES = ("rosbridge", "foxglove", "auto")
"""Values of `via` that never reach a Zenoh router."""


def is_lossy(driver: Driver, transport: str) -> bool:
    """Return whether written data may be lost on this transport without an error."""
    return driver.transports[transport].type in _LOSSY


def restored_s(driver: Driver, transport: str) -> float:
    """Return how long a stop is repeated after a reconnection on this transport, in seconds.

    After a restart of a Zenoh router, the robot may connect to the router later than URC.
    """
    spec = driver.transports[transport]
    via = spec.options.get("via", "rosbridge")  # a template may select zenoh
    is_late = spec.type == "zenoh" or (spec.type == "ros" and via not in _BRIDGES)
    return LATE_STOP_S if is_late else STOP_FOR_S
