"""The engine: the synchronous state machine of one driver.

The engine is pure: it has no I/O, clock, callbacks or tasks. The owner of a transport passes
received data and the time to the engine, and executes the returned events. Live robots, document
tests, playback and the simulator share this engine.

    events = engine.start("wire", now)            # the transport is connected
    events = engine.receive("wire", data, now)    # bytes were received
    events = engine.closed("wire", "why", now)    # the transport is not connected
    events = engine.command(request, now)         # a command was requested
    events = engine.tick(now)                     # `engine.deadline` has been reached
    events = engine.finish(now)                   # close gracefully; each connection ends with a
        `Close`

If the engine returns `Close`, it has already discarded its state of the connection. The owner must
then close the connection without calling `closed`.

Theory of operation. Conversations, polls, commands and sequences do not call each other. A
conversation also returns internal events: `ExchangeEnded` for a finished request, `Matched` for an
expected frame, and `ConnectionClosing`. `_settle` handles internal events and advances the
sequences until only external events remain.
"""

from collections.abc import Mapping, Sequence

from urc.model.driver import Command, Driver
from urc.model.payload import RESTARTED, Envelope, Payload
from urc.model.values import WHOLE_TYPES, Reading, Sample, Value
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    MotionReady,
    MotionRefused,
    Noted,
    NumbersUsed,
    Open,
    Ready,
    Replied,
    Request,
    Samples,
    Send,
    Violation,
)
from urc.protocol.motion_encoder import MotionEncoder
from urc.protocol.readings.readings import Readings
from urc.protocol.requests.bounds import GOOD_BYE_S, calm_s, lines_of, needs_readings
from urc.protocol.requests.condition_scope import SignalState
from urc.protocol.requests.connection import GOAL
from urc.protocol.requests.conversation import Conversation
from urc.protocol.requests.encode import BadArgument, build_check
from urc.protocol.requests.exchange import (
    ConnectionClosing,
    ExchangeEnded,
    ExchangeOutcome,
    LineEvent,
    ReplySink,
)
from urc.protocol.requests.goal_watch import GoalWatch, OnGoal
from urc.protocol.requests.reply_match import Matched
from urc.protocol.requests.request_compiler import RequestCompiler
from urc.protocol.schedule import PollSchedule
from urc.protocol.sequences.actions import build_program, programs_of_lines
from urc.protocol.sequences.commands import (
    Verifications,
    exchange_of,
    is_guarded,
    why_refused,
)
from urc.protocol.sequences.sequence_runner import SequenceRunner, Sink, Unless
from urc.protocol.times import soonest
from urc.protocol.values.time_and_nonce import FIXED, TimeAndNonce

__all__ = ["Engine"]


_PLAIN = frozenset(
    (Send, Violation, Noted, Open, Ready, Replied, Failed, NumbersUsed, MotionReady, MotionRefused)
)
"""Event types that the engine returns unchanged."""


class Engine:
    """The protocol state machine of one driver.

    All engine methods return lists of events and are not re-entrant.

    Args:
        driver: a loaded driver, with compiled patterns and templates.
        settings: values of all settings in the profile, keyed by name.
        fresh: sources of time and randomness for sent frames; tests pass fixed sources.
        is_compiled: whether to generate a function for each message and command. Generated
            functions save time in live sessions. In short document tests, generating the functions
            takes more time than it saves.

    Raises:
        BadArgument: a constant frame contains its own delimiter or cannot be encoded.
    """

    def __init__(
        self,
        driver: Driver,
        settings: Mapping[str, Value],
        *,
        fresh: TimeAndNonce = FIXED,
        is_compiled: bool = False,
    ) -> None:
        names: dict[str, object] = {"settings": dict(settings)}
        self.readings = Readings(driver.signals, names)
        self.known = SignalState(driver.signals, names)
        builder = RequestCompiler(driver, self.readings, self.known, fresh, is_compiled=is_compiled)
        self.lines: Mapping[str, Conversation] = builder.lines
        self._all_lines = tuple(self.lines.values())
        self._whole = {name: _whole_of(driver, name) for name in driver.transports}
        self._commands = driver.commands
        self._checks = {
            name: build_check(one, is_compiled=is_compiled) for name, one in driver.commands.items()
        }
        self._guarded = {name for name, one in driver.commands.items() if is_guarded(one)}
        self._asks = {
            name: builder.command(command)
            for name, command in driver.commands.items()
            if not command.steps
        }
        self.programs = {
            name: build_program(name, command.steps, lines_of(name, driver), builder)
            for name, command in driver.commands.items()
            if command.steps
        }
        self.motions = MotionEncoder(
            self._commands, self._checks, self._asks, self.lines, self.known
        )
        self._greetings = programs_of_lines(driver, builder, "on_connect")
        self._good_byes = programs_of_lines(driver, builder, "on_close")
        self._schedule = PollSchedule(driver, builder, self.known)
        self._runners: list[SequenceRunner] = []
        self._verifications = Verifications(self.known)
        has_scripts = self.programs or self._greetings or self._good_byes
        is_timed = any(line.receiver.is_timed for line in self._all_lines)
        self._calm_s = 0.0 if has_scripts or is_timed else calm_s(driver)
        self._is_begun = False
        self._is_timed = self._schedule.keeps_alive or self.readings.is_timed
        self._is_watched = needs_readings(driver)
        """Whether conditions or steps of the driver may use samples, so samples must be stored."""

    # -- methods

    @property
    def deadline(self) -> float | None:
        """Time of the next `tick`; minus infinity before the first tick, None if nothing is due."""
        if not self._is_begun:
            return float("-inf")
        first: float | None = None
        for line in self._all_lines:
            time = line.deadline
            if time is not None and (first is None or time < first):
                first = time
        time = self._schedule.next_poll
        if time is not None and (first is None or time < first):
            first = time
        if self._is_timed or self._runners or self._verifications.is_waiting:
            times = [first, self.readings.deadline, self._verifications.deadline]
            times += self._schedule.next_words
            times += [runner.deadline for runner in self._runners]
            return soonest(times)
        return first

    @property
    def calm_s(self) -> float:
        """Minimum time from a command or received data to a deadline that it sets, in seconds."""
        return self._calm_s

    def start(self, transport: str, now: float) -> list[Event]:
        """Record that `transport` is connected."""
        line = self.lines[transport]
        self._down(line, "the connection was replaced by a new one")
        self.readings.forget(self._whole[transport])
        events = line.opened(now)
        greeting = self._greetings.get(transport)
        if greeting is None:
            self._schedule.up(line, now)
        else:

            def greeted(outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
                if outcome.code:
                    return line.fail(outcome.message, now)
                self._schedule.up(line, now)
                return line.ready(now)

            limit_s = line.spec.timeouts.on_connect_s
            ends_at = None if limit_s is None else now + limit_s
            runner = SequenceRunner(self, greeting, greeted, transport, ends_at=ends_at)
            runner.variables = line.learnt
            self._start_sequence(runner)
        return self._settle(events, now) + self._submit_polls(now)

    def closed(self, transport: str, reason: str, now: float) -> list[Event]:
        """Record that `transport` is disconnected, or that connecting failed."""
        line = self.lines[transport]
        events = line.closed(reason, now)
        self._down(line, reason or "the robot closed the connection")
        return self._settle(events, now)

    def receive(
        self, transport: str, data: Payload, now: float, *, is_new: bool = True
    ) -> list[Event]:
        """Process bytes or an envelope received on `transport`.

        `is_new` is false if the robot has sent nothing since the last call. The transport itself
        has then made the envelope, or has held it back. Such an envelope ends no silence.
        """
        if isinstance(data, Envelope) and data.verb == RESTARTED:
            self.readings.forget_stamps()
            return []
        return self._settle(self.lines[transport].receive(data, now, is_new=is_new), now)

    def command(self, request: Request, now: float) -> list[Event]:
        """Run a command; exactly one `Replied` or `Failed` reports the outcome."""
        asked, people = ReplySink(request), request.confirmed_by
        events = self.run(
            request.command,
            request.arguments,
            asked,
            now,
            confirmed_by=people,
            unless=request.unless,
            on_goal=request.on_goal,
        )
        return self._settle(events, now)

    def may_send_goal(self, command: str) -> bool:
        """Return whether a command sends a goal of a ROS action, or is a sequence, which may."""
        found = self._commands.get(command)
        is_goal = found is not None and found.send.options.get("verb") == GOAL
        return is_goal or command in self.programs

    def tick(self, now: float) -> list[Event]:
        """Process all deadlines up to `now`."""
        if not self._is_begun:
            self._is_begun = True
            self._schedule.start(now)
        events: list[LineEvent] = []
        for line in self._all_lines:
            events += line.tick(now)
        if late := self.readings.tick(now):
            events.append(Samples("", tuple(late)))
        for runner in self._runners:
            if runner.deadline is not None and runner.deadline <= now:
                runner.expire(now)
        if self._verifications.deadline is not None:
            events += self._verifications.tick(now)
        told = self._settle(events, now) if events or self._runners else []
        return told + self._submit_polls(now)

    def latch(self, reason: str, now: float) -> list[Event]:
        """Stop all sequences and refuse autonomous motion; an empty `reason` allows motion again.

        Login sequences continue, because a stop can reach the robot only after the login.
        """
        self.known.latch(reason)
        if not reason:
            return []
        for line in self._all_lines:
            if line.codec is not None:
                line.codec.stop_goals()
        for runner in self._runners:
            if runner.program.label in self.programs and not runner.privileged_on:
                runner.stop("stopped", reason)
        return self._settle([], now)

    def finish(self, now: float) -> list[Event]:
        """Run ``on_close`` on all connections; a `Close` for each follows within `GOOD_BYE_S`."""
        events: list[LineEvent] = []
        self._schedule.stop()
        for line in self.lines.values():
            if line.is_open and not line.is_per_request:
                was_ready = line.is_ready
                self._down(line, "the connection is being closed")
                events += line.leave(now) if was_ready else line.shut(now)
        return self._settle(events, now)

    # -- commands and sequences

    def run(
        self,
        command: str,
        arguments: Mapping[str, object],
        sink: Sink,
        now: float,
        *,
        privileged_on: str = "",
        confirmed_by: tuple[str, ...] = (),
        unless: Unless | None = None,
        on_goal: OnGoal | None = None,
    ) -> list[LineEvent]:
        """Run a command or sequence and report the outcome to `sink` exactly once.

        If `unless` returns a reason at the time of sending, the command fails instead. In a
        sequence, only goals are checked. `on_goal` is described in `Request`.
        """
        found = self._commands.get(command)
        if found is None:
            known = ", ".join(self._commands) or "none"
            text = f"there is no command {command!r}; the commands are: {known}"
            return sink(ExchangeOutcome("unknown-command", text), now)
        try:
            values = self._checks[command](arguments)
        except BadArgument as error:
            return sink(ExchangeOutcome("bad-argument", str(error)), now)
        if command in self._guarded:
            refused = why_refused(found, self.known, values, confirmed_by, now)
            if refused is not None:
                return sink(refused, now)
        program = self.programs.get(command)
        if program is None:
            return self._send(found, values, sink, now, privileged_on, unless, on_goal)
        if any(runner.program is program for runner in self._runners):
            return sink(ExchangeOutcome("at-work", f"{command} is already running"), now)
        runner = SequenceRunner(self, program, sink, privileged_on, confirmed_by)
        runner.unless, runner.on_goal = unless, on_goal
        runner.wait_for_logins(now)
        self._start_sequence(runner)
        return []

    def _send(
        self,
        command: Command,
        values: Mapping[str, Reading],
        sink: Sink,
        now: float,
        on: str,
        unless: Unless | None,
        on_goal: OnGoal | None,
    ) -> list[LineEvent]:
        if command.verify is not None and self._verifications.is_full:
            return sink(ExchangeOutcome("queue-full", "too many commands await verification"), now)
        ask = self._asks[command.name]
        try:
            exchange = exchange_of(command, ask, values, sink, now, self.known, self._verifications)
        except BadArgument as error:
            return sink(ExchangeOutcome("bad-argument", str(error)), now)
        exchange.is_privileged = on == command.transport
        exchange.unless = unless
        if on_goal is not None and command.send.options.get("verb") == GOAL:
            exchange.goal = GoalWatch(on_goal)
        return self.lines[command.transport].submit(exchange, now)

    def _start_sequence(self, runner: SequenceRunner) -> None:
        self._runners.append(runner)
        for line in self._all_lines:
            line.is_scripted = True

    # -- handling of internal events

    def _settle(self, events: list[LineEvent], now: float) -> list[Event]:
        """Handle all internal events; return the external events."""
        told: list[Event] = []
        pending = events
        while True:
            for event in pending:
                self._act(event, told, now)
            pending = self._verifications.check(now) if self._verifications.has_news else []
            if self._runners:
                pending += self._advance(now)
                if any(runner.can_go_on for runner in self._runners):
                    continue
            if pending:
                continue
            for line in self._all_lines:
                if line.is_behind:
                    pending += line.process_frames(now)
            if not pending:
                return told

    def _act(self, event: LineEvent, told: list[Event], now: float) -> None:
        """Handle one event; append the resulting external events to `told`."""
        if type(event) in _PLAIN:
            told.append(event)  # type: ignore[arg-type]  # external events
        elif isinstance(event, ExchangeEnded):
            exchange, outcome = event
            if exchange.goal is not None and exchange.ask.answers:
                exchange.goal.ended(outcome.code)
            for one in exchange.owner.ended(exchange, outcome, now):
                self._act(one, told, now)
        elif isinstance(event, Matched):
            if event.expectation.owner is not None:
                event.expectation.owner.matched(event.expectation, event.offer, now)
        elif isinstance(event, ConnectionClosing):
            self._say_good_bye(self.lines[event.transport], now)
        else:
            if isinstance(event, Samples):
                self._note_readings(event.samples, now)
            elif isinstance(event, Close):
                self._down(self.lines[event.transport], event.reason or "the connection was closed")
            told.append(event)

    def _note_readings(self, samples: Sequence[Sample], now: float) -> None:
        if self._is_watched:
            self.known.update(samples)
            self._verifications.has_news = True
            for runner in self._runners:
                runner.check_conditions(now)

    def _advance(self, now: float) -> list[LineEvent]:
        """Advance every sequence until it waits or ends; return the resulting events."""
        pending: list[LineEvent] = []
        for runner in tuple(self._runners):
            pending += runner.advance(now)
        self._runners = [runner for runner in self._runners if not runner.is_over]
        if not self._runners:
            for line in self._all_lines:
                line.is_scripted = False
        return pending

    def _say_good_bye(self, line: Conversation, now: float) -> None:
        name = line.spec.name

        def said(outcome: ExchangeOutcome, now: float) -> list[LineEvent]:
            return line.shut(now) if line.is_open else []

        self._start_sequence(
            SequenceRunner(self, self._good_byes[name], said, name, ends_at=now + GOOD_BYE_S)
        )

    def _down(self, line: Conversation, reason: str) -> None:
        """Stop the sequences and polls of a lost connection."""
        name = line.spec.name
        for runner in self._runners:
            uses = name in runner.program.transports and not line.is_per_request
            if uses or runner.privileged_on == name:
                runner.stop("disconnected", reason)
        self._schedule.down(line)

    def _submit_polls(self, now: float) -> list[Event]:
        """Submit all due polls and keepalives."""
        told: list[Event] = []
        for events in self._schedule.submit_due(self.run, now):
            told += self._settle(events, now)
        return told


def _whole_of(driver: Driver, transport: str) -> tuple[str, ...]:
    """Return the signals of a transport whose messages update a part of the value."""
    return tuple(
        name
        for message in driver.messages.values()
        if message.transport == transport
        for name in message.read.fields
        if name in driver.signals and driver.signals[name].type in WHOLE_TYPES
    )
