"""Frames of motion: what moves a robot for as long as it is held, and what stops it.

Floor 3, pure. These frames do not go through the queue of their line: whoever owns the wire writes
the newest one, and the stop before anything else. All that a command must fulfil before it is sent,
a frame of motion must fulfil, too.
"""

from collections.abc import Callable, Container, Mapping
from functools import partial
from typing import Final

from urc.expressions import COUNTERS
from urc.model.driver import Command
from urc.model.exchange import MOST_STOPS
from urc.model.payload import CountedFrame, FrameVariants, Numbered, Payload
from urc.model.values import Reading
from urc.problems import UrcError
from urc.protocol.requests.condition_scope import SignalState
from urc.protocol.requests.conversation import Conversation
from urc.protocol.requests.encode import BadArgument, check_arguments
from urc.protocol.requests.exchange import CompiledRequest
from urc.protocol.requests.rate import Made
from urc.protocol.sequences.commands import is_guarded, why_refused

__all__ = ["MotionEncoder", "MotionRefused"]

_SPARE_STOPS: Final = 24
"""Numbers that other frames may use up before the stops are rendered again."""

Check = Callable[[Mapping[str, object]], dict[str, Reading]]


class MotionRefused(UrcError):
    """Motion that is not allowed now; the message says why."""


class _Way:
    """What a frame of one held command takes: looked up once, for there are many a second."""

    __slots__ = ("ask", "check", "command", "is_guarded", "line")

    def __init__(
        self, command: Command, check: Check, ask: CompiledRequest, line: Conversation
    ) -> None:
        self.command, self.check, self.ask, self.line = command, check, ask, line
        self.is_guarded = is_guarded(command)


class MotionEncoder:
    """The held commands of one driver."""

    def __init__(
        self,
        commands: Mapping[str, Command],
        checks: Mapping[str, Check],
        asks: Mapping[str, CompiledRequest],
        lines: Mapping[str, Conversation],
        known: SignalState,
    ) -> None:
        """Take what the engine has built of the commands; nothing is copied."""
        self._held = {name: one for name, one in commands.items() if one.hold is not None}
        self._ways = {
            name: _Way(one, checks[name], asks[name], lines[one.transport])
            for name, one in self._held.items()
        }
        self._asks = asks
        self._lines = lines
        self._known = known
        self._counting: dict[str, int] = {}
        """Line → how many controls it has whose frames carry numbers; none: left out."""
        self._made: dict[str, Made] = {}
        """Command → its stops that were rendered already."""
        self._lengths: dict[str, int] = {}
        """Line that is shared → stops of each control that are rendered in advance."""
        self.on_count: Callable[[str], None] = _nobody
        """Told the line on which a number was used up that the stops made so far come after."""
        self.on_ready: Callable[[str], None] = _nobody
        """Told the line that was connected, and is ready for everybody."""
        self.on_refused: Callable[[str, str], None] = _unrefused
        """Told a held command that the robot refuses, and in which words."""
        for one, command in self._held.items():
            line = command.transport
            lines[line].on_ready = partial(self._told_ready, line)
            lines[line].on_refused = self._told_refused
            if asks[one].answers:
                lines[line].held.add(one, asks[one].answers[0], asks[one].match)
            if asks[one].has_counters:
                lines[line].counters.counted = partial(self._counted, line)
                self._counting[line] = self._counting.get(line, 0) + 1

    def share(self, repeating: Container[str]) -> None:
        """Leave the numbers of frames to whoever writes motion, who says how they stand.

        Args:
            repeating: lines on which a stop is sent several times, because it may be lost.
        """
        for line, controls in self._counting.items():
            self._lines[line].counters.is_shared = True
            self._lengths[line] = controls * (MOST_STOPS if line in repeating else 1) + _SPARE_STOPS

    def set_counters(self, line: str, stand: Mapping[str, int], is_settled: bool) -> None:
        """Take how the shared counters of a line stand.

        Args:
            line: its name.
            stand: counter → the last number that has left.
            is_settled: whether no frame of the engine is still on its way.
        """
        if line in self._lengths:
            self._lines[line].counters.set_counters(stand, is_settled=is_settled)
            self.on_count(line)

    def is_lasting(self, command: str) -> bool:
        """Return whether its stop is the same bytes for ever; else it is to be made anew.

        It is not where it carries a number, or what the robot or a setting says. Nor does it count
        as such where one side of the line talks at a time, and each frame made may owe an answer.
        """
        ask, line = self._asks[command], self._lines[self._found(command).transport]
        return ask.is_local and not (ask.has_counters or line.spec.is_half_duplex)

    def has_stops(self, command: str) -> bool:
        """Return whether the stops that were made last are enough for now.

        They are while most of those that were made to spare are left, and while they depend on
        nothing but their numbers.
        """
        made, line = self._made.get(command), self._found(command).transport
        if made is None or not self._asks[command].is_local or line not in self._lengths:
            return False
        return self._lines[line].counters.is_near(made, _SPARE_STOPS // 2)

    def is_ready(self, command: str) -> bool:
        """Return whether its line is connected, and the steps of the connection are done."""
        line = self._lines[self._found(command).transport]
        return line.is_open and line.is_ready

    def stop_frame(self, command: str) -> Payload | FrameVariants:
        """Return what stops the motion of `command`: bytes, framing included, or an envelope.

        It needs no connection. Where it carries a number, that is a series: the frame for each
        number that it may have when it leaves, as many as all stops of the line may need.
        A robot that moves in steps stops by itself, and is told nothing: no bytes at all.

        Raises:
            BadArgument: it is no motion, or cannot be written.
        """
        found = self._found(command)
        hold, ask, line = found.hold, self._asks[command], self._lines[found.transport]
        if hold is not None and hold.step_s is not None:
            return b""
        values = check_arguments(found, {} if hold is None else hold.release)
        names = {**self._known.names, **line.learnt, **values}
        if not ask.has_counters:
            return ask.encode(names)
        return line.counters.series(
            lambda draw: ask.encode({**names, COUNTERS: draw}),
            self._lengths.get(found.transport, 1),
            # What the robot says may have changed since.
            self._made.setdefault(command, {}) if ask.is_local else {},
        )

    def motion_frame(
        self,
        command: str,
        arguments: Mapping[str, object],
        now: float,
        confirmed_by: tuple[str, ...] = (),
    ) -> Payload | CountedFrame:
        """Return the frame of `command` with these arguments, as it is to be written now.

        On a line where one side talks at a time, it may be no bytes: the robot owes an answer, and
        the next value goes out instead.

        On a line that is shared, a number in it is only proposed: it counts once the frame has
        left, which `told` says.

        Args:
            command: one with `hold`.
            arguments: by name; those left out take their defaults.
            now: the time, for what the command requires of fresh signals.
            confirmed_by: people who said yes to it, where two must.

        Raises:
            BadArgument: it is no motion, or an argument is not as declared.
            NotNow: the line is not ready, the robot silent, what it requires does not hold, or
                nobody confirmed it.
        """
        way = self._ways.get(command)
        if way is None:
            raise BadArgument(f"{command!r} is no command with a release")
        line, ask = way.line, way.ask
        if line.motion_must_wait(now):
            return b""
        values = way.check(arguments)
        if not (line.is_open and line.is_ready):
            raise MotionRefused("the robot is not connected")
        if line.is_silent:
            raise MotionRefused(f"the robot has said nothing for {line.spec.stale_after_s:g} s")
        if way.is_guarded:
            refused = why_refused(way.command, self._known, values, confirmed_by, now)
            if refused is not None:
                raise MotionRefused(refused.message)
        line.gave_motion(command, values, now)
        names = values if ask.is_local else {**self._known.names, **line.learnt, **values}
        if not ask.has_counters:
            return ask.encode(names)
        draw = line.counters.draw_urgent()
        data = ask.encode({**names, COUNTERS: draw})
        if not line.counters.is_shared:
            line.counters.count(draw)
            return data
        again = partial(self._again, command, arguments, now, confirmed_by)
        return CountedFrame(Numbered(data, draw.count), again)

    def _again(
        self,
        command: str,
        arguments: Mapping[str, object],
        now: float,
        confirmed_by: tuple[str, ...],
    ) -> Numbered | None:
        """Make a frame of motion again: another frame has used up its numbers."""
        try:
            made = self.motion_frame(command, arguments, now, confirmed_by)
        except UrcError:
            return None
        return made.numbered if isinstance(made, CountedFrame) else None

    def _counted(self, line: str) -> None:
        self.on_count(line)

    def _told_ready(self, line: str) -> None:
        self.on_ready(line)

    def _told_refused(self, command: str, why: str) -> None:
        self.on_refused(command, why)

    def _found(self, command: str) -> Command:
        found = self._held.get(command)
        if found is None:
            raise BadArgument(f"{command!r} is no command with a release")
        return found


def _unrefused(command: str, why: str) -> None:
    """Nobody wants to know."""


def _nobody(line: str) -> None:
    """Nobody wants to know."""
