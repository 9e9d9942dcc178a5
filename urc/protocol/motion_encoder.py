"""Motion frames: setpoints and stops for held commands.

Pure. Motion frames bypass the connection's request queue. The owner of the transport sends only the
newest setpoint and sends a stop before any other frame. Setpoints must meet all requirements of the
command.
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
from urc.protocol.events import MotionEvent, NumbersUsed
from urc.protocol.requests.condition_scope import SignalState
from urc.protocol.requests.conversation import Conversation
from urc.protocol.requests.encode import BadArgument, check_arguments
from urc.protocol.requests.exchange import CompiledRequest
from urc.protocol.requests.rate import Made
from urc.protocol.sequences.commands import is_guarded, why_refused

__all__ = ["MotionEncoder", "MotionUnavailable"]

_SPARE_STOPS: Final = 24
"""Number of counter values that other frames may use before stops must be rendered again."""

Check = Callable[[Mapping[str, object]], dict[str, Reading]]


class MotionUnavailable(UrcError):
    """The robot cannot be moved at present; the message states the reason."""


class _Way:
    """The encoder for one held command; it is built in advance, because setpoints are frequent."""

    __slots__ = ("ask", "check", "command", "is_guarded", "line")

    def __init__(
        self, command: Command, check: Check, ask: CompiledRequest, line: Conversation
    ) -> None:
        self.command, self.check, self.ask, self.line = command, check, ask, line
        self.is_guarded = is_guarded(command)


class MotionEncoder:
    """The encoder for all held commands in one driver."""

    def __init__(
        self,
        commands: Mapping[str, Command],
        checks: Mapping[str, Check],
        asks: Mapping[str, CompiledRequest],
        lines: Mapping[str, Conversation],
        known: SignalState,
    ) -> None:
        """Initialise the encoder with the engine's mappings, which are shared, not copied."""
        self._held = {name: one for name, one in commands.items() if one.hold is not None}
        self._ways = {
            name: _Way(one, checks[name], asks[name], lines[one.transport])
            for name, one in self._held.items()
        }
        self._asks = asks
        self._lines = lines
        self._known = known
        self._counting: dict[str, int] = {}
        """Number of held commands with counters, keyed by connection."""
        self._made: dict[str, Made] = {}
        """Cached stop frames, keyed by command."""
        self._lengths: dict[str, int] = {}
        """Number of stops to render in advance for each held command, keyed by connection."""
        for one, command in self._held.items():
            line = command.transport
            lines[line].has_motion = True
            if asks[one].answers:
                lines[line].held.add(one, asks[one].answers[0], asks[one].match)
            if asks[one].has_counters:
                self._counting[line] = self._counting.get(line, 0) + 1

    def share(self, repeating: Container[str]) -> None:
        """Share the counters with the sender of motion frames, which must report the sent numbers.

        Args:
            repeating: connections on which every stop is sent several times, because frames may be
                lost.
        """
        for line, controls in self._counting.items():
            self._lines[line].counters.is_shared = True
            self._lengths[line] = controls * (MOST_STOPS if line in repeating else 1) + _SPARE_STOPS

    def set_counters(
        self, line: str, stand: Mapping[str, int], *, is_settled: bool
    ) -> list[MotionEvent]:
        """Store the counter numbers that were actually transmitted on a shared connection.

        Args:
            line: name of the connection.
            stand: last transmitted number of each counter.
            is_settled: whether all frames from the engine have been transmitted.
        """
        if line in self._lengths:
            self._lines[line].counters.set_counters(stand, is_settled=is_settled)
            return [NumbersUsed(line)]
        return []

    def is_lasting(self, command: str) -> bool:
        """Return whether the stop of `command` always has the same bytes.

        The result is False if the stop contains a counter, or values from the robot or from
        settings.
        """
        self._found(command)
        ask = self._asks[command]
        return ask.is_local and not ask.has_counters

    def has_stops(self, command: str) -> bool:
        """Return whether the rendered stops of `command` are still valid.

        Stops are valid while at least half of the spare counter numbers remain. Stops that depend
        on values other than arguments and counters are never valid.
        """
        made, line = self._made.get(command), self._found(command).transport
        if made is None or not self._asks[command].is_local or line not in self._lengths:
            return False
        return self._lines[line].counters.is_near(made, _SPARE_STOPS // 2)

    def is_ready(self, command: str) -> bool:
        """Return whether the connection of `command` is open and its login is complete."""
        line = self._lines[self._found(command).transport]
        return line.is_open and line.is_ready

    def stop_frame(self, command: str) -> Payload | FrameVariants:
        """Return the stop for `command`: bytes including framing, an envelope, or frame variants.

        A stop can be rendered without a connection. A stop with a counter is a series with one
        frame for each possible next number. The series is long enough for the stops of all held
        commands on the connection. The stop is empty if the robot ends each motion step
        automatically.

        Raises:
            BadArgument: the command is not held, or the stop cannot be written.
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
            # Values from the robot may have changed since the stops were rendered.
            self._made.setdefault(command, {}) if ask.is_local else {},
        )

    def motion_frame(
        self,
        command: str,
        arguments: Mapping[str, object],
        now: float,
        confirmed_by: tuple[str, ...] = (),
    ) -> Payload | CountedFrame:
        """Return the frame of `command` with `arguments`, ready to send.

        On a half-duplex connection, the returned frame is empty while a reply is pending. The
        caller then skips this setpoint and sends the next one later.

        On a shared connection, the frame's counter numbers are provisional until `set_counters`
        confirms them after the transmission.

        Args:
            command: name of a held command.
            arguments: values, keyed by name; missing arguments take their default values.
            now: current time in seconds, for requirements that need fresh signals.
            confirmed_by: names of the people who have confirmed the command, for the two-person
                rule.

        Raises:
            BadArgument: the command is not held, or an argument is invalid.
            MotionUnavailable: the connection is not ready, the robot is silent, a requirement is
                not met, or a confirmation is missing.
        """
        way = self._ways.get(command)
        if way is None:
            raise BadArgument(f"{command!r} is not a held command")
        line, ask = way.line, way.ask
        if line.motion_must_wait(now):
            return b""
        values = way.check(arguments)
        if not (line.is_open and line.is_ready):
            raise MotionUnavailable("the robot is not connected")
        if line.is_silent:
            raise MotionUnavailable(f"the robot has sent nothing for {line.spec.stale_after_s:g} s")
        if way.is_guarded:
            refused = why_refused(way.command, self._known, values, confirmed_by, now)
            if refused is not None:
                raise MotionUnavailable(refused.message)
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
        """Render a motion frame again after another frame has used its counter numbers."""
        try:
            made = self.motion_frame(command, arguments, now, confirmed_by)
        except UrcError:
            return None
        return made.numbered if isinstance(made, CountedFrame) else None

    def _found(self, command: str) -> Command:
        found = self._held.get(command)
        if found is None:
            raise BadArgument(f"{command!r} is not a held command")
        return found
