"""The client of the guard: the robot's guarded transports and the table of held commands.

Theory of operation. The guard's state is lost when the guard process dies. The client therefore
keeps a table of all held commands that were armed or stopped. Each entry stores the command's terms
and whether the robot may still be moving because of the command. A new guard is initialised from
this table. The new guard receives the list of transports, and a pending stop for each command that
may be moving the robot. The list contains the ROS goals that the robot may still follow, so that
STOP ends these goals, too. The new guard also receives the terms of other armed commands. For each
pending stop, the guard opens the connection and writes the stop first. After a restart of the
guard, motion never resumes automatically.

A command *may be moving* the robot from its first tick or stop request. This state ends when the
guard reports that it has written the stop after the newest tick. The state begins again if the
guard reports that this stop may have been lost with the connection. A pending stop is therefore not
lost when the guard process dies.
"""

import asyncio
from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Final, NamedTuple

from msgspec.structs import replace

from urc.guard import messages
from urc.guard.channel import Channel, ChannelListener, GuardedLineSpec
from urc.guard.goal_reports import GoalReports
from urc.guard.proxy import GuardedTransport, Stands
from urc.model.payload import Count, CountedFrame, FrameVariants, Numbered, Payload
from urc.motion.hold_to_run import HoldTerms, HoldToRun, StopReport
from urc.problems import UrcError
from urc.transports.base import SupportsGoals

__all__ = ["GuardClient", "HeldSpec"]

_MOST_STOPS: Final = 256
_TELLING_S: Final = 0.5
"""Maximum delay of a message between the guard and this client, in seconds."""
_UNCOUNTED: Final = Count({}, {})


class HeldSpec(NamedTuple):
    """One held command of the robot: its transport and its initial terms."""

    line: str
    terms: HoldTerms
    """Terms without a stop frame, for a stop before the control is first armed."""


@dataclass(slots=True)
class _Control:
    """A held command that has been armed or stopped."""

    line: str
    terms: HoldTerms
    is_armed: bool = False
    number: int = 0
    """Number of the newest tick, counted since the current guard started."""
    first: int = 0
    """Number of the first tick since the control was armed."""
    at_s: float = 0.0
    """Time of the newest tick on the guard's clock, in seconds."""
    until_s: float = inf
    """Time at which the newest tick's image is too old, on the guard's clock, in seconds."""
    counted: CountedFrame | None = None
    """Frame of the newest tick; None if the frame contains no counters."""
    may_move: bool = False
    stopped_s: float = float("-inf")
    """Time of the last written stop, as reported by the guard, in seconds."""


class GuardClient:
    """The guarded transports and the held commands of one robot.

    The client implements `urc.runtime.motion_controller.MotionBackend` and `ChannelListener`.
    """

    def __init__(
        self,
        lines: Sequence[GuardedLineSpec],
        held: Mapping[str, HeldSpec],
        channel_to: Callable[[ChannelListener], Channel],
    ) -> None:
        """Create the client; `start` starts the guard.

        Args:
            lines: the guarded transports; a tunnel precedes the transports that it carries.
            held: the held commands, keyed by name.
            channel_to: function that creates the channel for this client.
        """
        self.lines = tuple(lines)
        self.channel = channel_to(self)
        self.transports = {
            spec.make.line: GuardedTransport(
                spec.make.line,
                spec.transport.address,
                self.channel.post,
                self.channel.ready,
                self._stands,
            )
            for spec in lines
        }
        """Guarded transports, keyed by name; the session's links use these transports."""
        self.on_stand: Stands = _unheard
        """Callback that receives a transport's counters, and whether all of the engine's frames
        with counters were sent.
        """
        self._held = dict(held)
        self._controls: dict[str, _Control] = {}
        """Table of all commands that are armed or may be moving the robot."""
        self.goals = GoalReports(
            [spec.make.line for spec in lines if isinstance(spec.transport, SupportsGoals)]
        )
        """The guard's reports about goals."""
        self._stops: deque[tuple[str, StopReport]] = deque(maxlen=_MOST_STOPS)
        self._stopped = asyncio.Event()

    def start(self) -> None:
        """Start the guard; requires a running event loop."""
        self.channel.start()

    async def finish(self) -> None:
        """Stop commands that may be moving the robot, close all connections, and end the guard."""
        await self.channel.finish()

    # -- held commands: `urc.runtime.motion_controller.MotionBackend`

    def arm(self, command: str, terms: HoldTerms) -> None:
        """Arm `command`, so that the guard accepts its ticks from now on.

        Raises:
            UrcError: the terms contain no method to stop the motion.
        """
        try:
            HoldToRun(terms)
        except ValueError as fault:
            raise UrcError(f"{command}: {fault}") from fault
        control = self._control(command)
        control.terms = terms
        control.is_armed, control.first = True, control.number + 1
        self.channel.post(messages.ArmControl(control.line, command, terms))

    def tick(self, command: str, data: Payload | CountedFrame, for_s: float = inf) -> None:
        """Renew the lease of `command`, with `data` as the command's newest frame. Never waits.

        The lease ends after `for_s` seconds at the latest.
        """
        control = self._controls.get(command)
        if control is None or not control.is_armed:
            return  # the guard has stopped it, and would drop the tick
        control.number += 1
        control.at_s = self.channel.now()
        control.until_s = control.at_s + for_s
        control.may_move = True
        control.counted = data if isinstance(data, CountedFrame) else None
        numbered = data.numbered if isinstance(data, CountedFrame) else Numbered(data, _UNCOUNTED)
        self._post_tick(command, control, numbered)

    def _post_tick(self, command: str, control: _Control, numbered: Numbered) -> None:
        count = numbered.takes if numbered.takes.after else None
        tick = messages.RenewLease(
            command, control.number, numbered.data, control.at_s, count, control.until_s
        )
        self.channel.post(tick, slot=command)

    def renew(self, command: str, stop: Payload | FrameVariants) -> None:
        """Replace the stop frame of `command` without arming the command."""
        control = self._controls.get(command)
        if control is not None:
            control.terms = terms = control.terms.stopped_by(stop)
            renewal = messages.ReplaceStop(command, terms.stop, terms.stops)
            self.channel.post(renewal, slot=f"{command} stop")

    def is_armed(self, command: str) -> bool:
        """Return whether the guard accepts ticks of `command`."""
        control = self._controls.get(command)
        return control is not None and control.is_armed

    def release(self, command: str) -> None:
        """Stop `command`, because the operator has released its control."""
        self._discard_tick(command)
        self.channel.post(messages.ReleaseControl(command))

    def stop(self, stops: Mapping[str, Payload | FrameVariants]) -> None:
        """Stop commands immediately, even idle ones; `stops` maps commands to stop frames."""
        told: list[tuple[str, str, HoldTerms]] = []
        for command, frame in stops.items():
            control = self._control(command)
            control.terms = control.terms.stopped_by(frame)
            control.is_armed = False
            control.may_move = True  # until the guard reports that the stop was written
            self._discard_tick(command)
            told.append((control.line, command, control.terms))
        if told:
            self.channel.post(messages.StopMotion(told), is_urgent=True)

    def stop_all(self, stop_frame: Callable[[str], Payload | FrameVariants]) -> None:
        """Stop all commands that may be moving the robot.

        Args:
            stop_frame: function that returns the current stop frame of a command. If `stop_frame`
                raises `UrcError`, the last known stop frame is used.
        """
        stops: dict[str, Payload | FrameVariants] = {}
        for command, control in self._controls.items():
            if self.is_stopping(command):
                try:
                    stops[command] = stop_frame(command)
                except UrcError:
                    terms = control.terms
                    stops[command] = FrameVariants(terms.stops) if terms.stops else terms.stop
        self.stop(stops)

    def is_stopping(self, command: str) -> bool:
        """Return whether `command` may be moving the robot, or its stop may still be repeated."""
        control = self._controls.get(command)
        if control is None:
            return False
        since_s = self.channel.now() - control.stopped_s
        return control.may_move or since_s < control.terms.restored_s + _TELLING_S

    def owes_stop(self, command: str) -> bool:
        """Return whether `command` may be moving the robot: no written stop was reported."""
        control = self._controls.get(command)
        return control is not None and control.may_move

    def is_open(self, command: str) -> bool:
        """Return whether the guard last reported the connection of `command` as open."""
        return self.transports[self._held[command].line].is_open

    async def stops(self) -> Sequence[tuple[str, StopReport]]:
        """Wait for reports of written or lost stops; return each command with its report.

        If the wait is cancelled, no report is lost.
        """
        while not self._stops:
            self._stopped.clear()
            await self._stopped.wait()
        found = tuple(self._stops)
        self._stops.clear()
        return found

    def _control(self, command: str) -> _Control:
        control = self._controls.get(command)
        if control is None:
            control = self._controls[command] = _Control(*self._held[command])
        return control

    def _discard_tick(self, command: str) -> None:
        """Discard an unsent tick, so that it cannot start motion later."""
        self.channel.drop(command)
        control = self._controls.get(command)
        if control is not None:
            control.counted = None

    def end_cancellations(self, actions: Collection[str]) -> None:
        """End unanswered cancellations of `actions`, also in a guard that starts later."""
        for line in self.goals.end(actions):
            self.channel.post(messages.EndCancellations(line, tuple(actions)))

    # -- the guard: `ChannelListener`

    @property
    def may_move(self) -> bool:
        """Whether the robot may be moving because of a control."""
        return any(control.may_move for control in self._controls.values())

    def briefing(self) -> Iterator[messages.ToGuard]:
        """Yield the messages that initialise a new guard: pending stops, then armed controls."""
        for spec in self.lines:
            goals = self.goals.record(spec.make.line)
            yield spec.make if goals is None else replace(spec.make, goals=goals)
        for command, control in self._controls.items():
            control.number, control.first = 0, 1
            if control.may_move:
                control.is_armed = False
                yield messages.RecoverStop(control.line, command, control.terms)
            elif control.is_armed:
                yield messages.ArmControl(control.line, command, control.terms)

    def handle(self, message: messages.FromGuard, size: int) -> None:
        """Handle a message from the guard; `size` is its size in bytes for flow control."""
        if isinstance(message, messages.StopWritten):
            self._record_stop(message)
        elif isinstance(message, messages.StopDue):
            self._record_due(message.control)
        elif isinstance(message, messages.GoalsChanged):
            self.goals.changed(message.line, message.record)
        elif not isinstance(message, messages.Heartbeat):
            self.transports[message.line].handle(message, size)
            if isinstance(message, messages.LineLost | messages.LineClosed):
                self._disarm(message.line)
            if isinstance(message, messages.CountersAdvanced):
                self._tick_again(message)

    def lost(self, reason: str) -> None:
        """Handle the end of the guard, which also ends every connection."""
        for transport in self.transports.values():
            transport.lost(reason)

    def _stands(self, line: str, stand: Mapping[str, int], is_settled: bool) -> None:
        self.on_stand(line, stand, is_settled)

    def _tick_again(self, counted: messages.CountersAdvanced) -> None:
        """Render pending ticks again after other frames used their counter values.

        Each tick keeps its original time.
        """
        for command, number in counted.stale:
            control = self._controls.get(command)
            if control is None or control.counted is None or control.number != number:
                continue  # the control was released, or a newer tick is on its way
            numbered = control.counted.again()
            if numbered is not None:
                self._post_tick(command, control, numbered)

    def _record_stop(self, stopped: messages.StopWritten) -> None:
        control = self._controls.get(stopped.control)
        if control is not None:
            control.stopped_s = self.channel.now()
            # A stop since the last arming disarms the control: the guard drops all newer ticks.
            is_disarmed = stopped.reason != "released" and stopped.number >= control.first
            if is_disarmed:
                control.is_armed = False
                control.counted = None
            if is_disarmed or stopped.number == control.number:  # else a newer tick is on its way
                control.may_move = False
        self._report(stopped.control, stopped.reason)

    def _record_due(self, command: str) -> None:
        """Record that the stop of `command`, reported as written, may have been lost."""
        control = self._controls.get(command)
        if control is not None and not control.may_move:
            control.may_move = True
            control.is_armed = False
            self._report(command, "lost")

    def _disarm(self, line: str) -> None:
        """Record that the guard has disarmed the controls of a closed connection."""
        for control in self._controls.values():
            if control.line == line:
                control.is_armed = False

    def _report(self, command: str, report: StopReport) -> None:
        self._stops.append((command, report))
        self._stopped.set()


def _unheard(line: str, stand: Mapping[str, int], is_settled: bool) -> None:
    """Ignore the counters."""
