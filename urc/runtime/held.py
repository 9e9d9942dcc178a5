"""What the desk of a robot is made of: its held commands, and what it asks of others."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

from urc.model.codec import Counted, Payload, Series
from urc.model.driver import Command, Driver
from urc.model.flow import Hold
from urc.model.values import Reading
from urc.motion.hold import Reason, Terms
from urc.motion.slew import Slew
from urc.motion.stall import STALLED_S

__all__ = ["Control", "Frames", "Movers", "control_of", "is_lossy", "period_of"]


class Frames(Protocol):
    """What is asked of the engine: `urc.protocol.motions.Motions`."""

    on_count: Callable[[str], None]
    """To be set: told a line on which a number was used up that its stops must come after."""
    on_ready: Callable[[str], None]
    """To be set: told a line that was connected, once its start-up steps are done."""
    on_refused: Callable[[str, str], None]
    """To be set: told a held command that the robot refuses, and in which words."""

    def is_lasting(self, command: str) -> bool:
        """Return whether the stop of a held command is the same for ever."""

    def has_stops(self, command: str) -> bool:
        """Return whether the stops that it was given last are enough for now."""

    def is_ready(self, command: str) -> bool:
        """Return whether its line is connected, and its start-up steps are done."""

    def stop_frame(self, command: str) -> Payload | Series:
        """Return what stops the motion of a held command; raise `UrcError` when it cannot."""

    def motion_frame(
        self, command: str, arguments: Mapping[str, Reading], now: float
    ) -> Payload | Counted:
        """Return the frame of a held command; raise `UrcError` that says why not."""


class Movers(Protocol):
    """Who owns the wire: the guard process, or this one."""

    def arm(self, command: str, terms: Terms) -> None:
        """Take ticks of `command` from now on, under these terms."""

    def tick(self, command: str, data: Payload | Counted) -> None:
        """Renew the lease of `command`; `data` is its newest frame."""

    def renew(self, command: str, stop: Payload | Series) -> None:
        """Let `stop` be what stops `command` from now on; it arms nothing."""

    def is_stopping(self, command: str) -> bool:
        """Return whether `command` may be moving, or its stop may still be repeated."""

    def is_open(self, command: str) -> bool:
        """Return whether its line is connected, by the newest that is known."""

    def release(self, command: str) -> None:
        """Stop `command`, which was let go."""

    def stop(self, stops: Mapping[str, Payload | Series]) -> None:
        """Stop at once, whatever moves; these are the stop frames of all held commands."""

    async def stops(self) -> Sequence[tuple[str, Reason]]:
        """Wait for the next stop frames that were written: command, and why it stopped.

        In their order, at least one. Being cancelled loses none. A control that `stop` stopped is
        told with ``stopped`` even when it did not move: it says that the robot's line took it.
        """


@dataclass(slots=True)
class Control:
    """One held command, as its screen knows it."""

    line: str
    hold: Hold
    period_s: float
    """Between two of its frames, at least."""
    slew: Slew | None
    defaults: Mapping[str, Reading]
    """Of the arguments that it limits."""
    is_greeted: bool
    """The line has start-up steps: what is said before them may not count."""
    is_armed: bool = False
    is_lasting: bool = False
    """What stops it is the same for as long as it is armed."""
    course: Literal["rest", "moving", "ending"] = "rest"
    """``ending``: it was let go, and nobody has said yet that its stop was written."""
    stop: Payload | Series | None = None
    """What stops it, as the movers know it."""
    is_owed_again: bool = False
    """Its stop went out on a line that was not ready: it is repeated when it is."""
    needs_release: bool = False
    why: str = ""
    """What closed it, where it needs that."""
    closed_epoch: int = -1
    """Lease in which it stopped by itself: it goes on in a later one only."""

    def rest(self) -> None:
        """Take note that it is to stand."""
        if self.slew is not None:
            self.slew.begin()

    def close(self, why: str, epoch: int) -> None:
        """Take no tick until it was let go, and the lease was taken anew after `epoch`.

        What closed it first is why: the rest follows from that.
        """
        if not self.needs_release:
            self.why = why
        self.rest()
        self.course = "rest"
        self.is_armed = False
        self.needs_release = True
        self.closed_epoch = epoch

    def limited(self, arguments: Mapping[str, Reading], now: float) -> Mapping[str, Reading]:
        """Return what may be asked of the robot now, of what its driver wants."""
        if self.slew is None:
            return arguments
        return self.slew.limit({**self.defaults, **arguments}, now)


def control_of(driver: Driver, command: Command) -> Control:
    """Return a held command of `driver`, at rest."""
    hold = command.hold
    assert hold is not None  # noqa: S101 - no others are asked for
    slew, defaults = None, {}
    if hold.slew:
        arguments = command.arguments
        defaults = {name: arguments[name].default for name in hold.slew if name in arguments}
        rest = {name: one.default for name, one in command.arguments.items()} | dict(hold.release)
        slew = Slew(hold.slew, rest, hold.repeat_s)
    greeted = bool(driver.transports[command.transport].on_connect)
    return Control(command.transport, hold, period_of(driver, command), slew, defaults, greeted)


def period_of(driver: Driver, command: Command) -> float:
    """Return the shortest time between two frames of a held command: what may be sent at all."""
    hold = command.hold
    repeat_s = STALLED_S if hold is None else hold.repeat_s
    rate_s = 1 / command.rate_per_s if command.rate_per_s else 0.0
    is_realtime = command.priority == "realtime"
    gap_s = 0.0 if is_realtime else driver.transports[command.transport].min_gap_s
    return max(repeat_s, rate_s, gap_s)


_LOSSY = frozenset(("udp", "serial", "mqtt", "rosbridge"))
"""Kinds of line on which one stop may be lost on the way."""


def is_lossy(driver: Driver, transport: str) -> bool:
    """Return whether what is written to a line may be lost on the way without anybody noticing."""
    return driver.transports[transport].type in _LOSSY
