"""The engine: the synchronous state machine of one driver.

Floor 3, pure: no I/O, no clock, no callback, no task. Whoever owns a transport tells the engine
what happened and when, and performs the events that come back. The live robot, the documents' own
tests, replay and the simulator all use this one engine.

    events = engine.start("wire", now)            # the transport is connected
    events = engine.receive("wire", data, now)    # bytes came in
    events = engine.closed("wire", "why", now)    # it is not connected any more, or never was
    events = engine.command(request, now)         # somebody wants something
    events = engine.tick(now)                     # `engine.deadline` has come
    events = engine.finish(now)                   # say good-bye; each line ends with a `Close`

A `Close` among the events means that the engine has forgotten that connection: close it, and do
not report it by `closed`.

Theory of operation. Lines, polls, commands and sequences do not call each other: a line says that a
request has `Ended`, that something was `Heard`, or that it is `Leaving`, as events inside the list
that it returns. `_settle` takes these out, tells those concerned, and lets sequences go on, until
nothing is left but what the outside must perform.
"""

from collections.abc import Mapping
from functools import partial

from urc.expressions import COUNTERS
from urc.model.driver import Command, Driver
from urc.model.flow import Keepalive
from urc.model.values import Value
from urc.protocol.asking import Builder
from urc.protocol.bounds import GOOD_BYE_S, lines_of
from urc.protocol.commands import CommandRun, Verifications, why_not_allowed
from urc.protocol.encode import BadArgument, build_check, check_arguments
from urc.protocol.events import (
    Close,
    Event,
    Failed,
    Fault,
    Open,
    Replied,
    Request,
    Samples,
    Send,
)
from urc.protocol.exchange import Ended, Exchange, Heard, Leaving, LineEvent, Outcome, expires_at
from urc.protocol.gate import Counters
from urc.protocol.known import Known
from urc.protocol.line import Line
from urc.protocol.readings import Readings
from urc.protocol.schedule import KeptAlive, PollState
from urc.protocol.steps import Program, Runner, Sink, build_program
from urc.protocol.times import soonest

__all__ = ["Engine"]

_PLAIN = frozenset((Send, Fault, Open, Replied, Failed))
"""Events that mean nothing to the engine itself."""


class Engine:
    """One driver at work. Not safe to re-enter; every verb returns a list of events.

    Args:
        driver: as loaded; its patterns and templates are compiled already.
        settings: value of every setting of the profile.

    Raises:
        BadArgument: a constant frame contains its own delimiter, or cannot be encoded.
    """

    def __init__(self, driver: Driver, settings: Mapping[str, Value]) -> None:
        names: dict[str, object] = {"settings": dict(settings)}
        self.readings = Readings(driver.signals, names)
        self.known = Known(driver.signals, names)
        builder = Builder(driver, self.readings)
        self.lines: Mapping[str, Line] = builder.lines
        self._all_lines = tuple(self.lines.values())
        self._commands = driver.commands
        self._checks = {name: build_check(one) for name, one in driver.commands.items()}
        self._asks = {
            name: builder.command(command)
            for name, command in driver.commands.items()
            if not command.steps
        }
        self._programs = {
            name: build_program(name, command.steps, lines_of(name, driver), builder)
            for name, command in driver.commands.items()
            if command.steps
        }
        self._greetings = self._of_lines(driver, builder, "on_connect")
        self._good_byes = self._of_lines(driver, builder, "on_close")
        self._polls = [
            PollState(
                poll,
                builder.poll(poll, poll.name or f"polls.{place}"),
                self.lines[poll.transport],
                self.known,
            )
            for place, poll in enumerate(driver.polls)
        ]
        self._kept_alive = {
            name: self._keeper(name, spec.keepalive, builder)
            for name, spec in driver.transports.items()
            if spec.keepalive is not None
        }
        self._runners: list[Runner] = []
        self._verifications = Verifications(self.known)
        self._is_begun = False

    def _of_lines(self, driver: Driver, builder: Builder, key: str) -> dict[str, Program]:
        return {
            name: build_program(f"{name}.{key}", getattr(spec, key), frozenset((name,)), builder)
            for name, spec in driver.transports.items()
            if getattr(spec, key)
        }

    def _keeper(self, name: str, keepalive: Keepalive, builder: Builder) -> KeptAlive:
        send = keepalive.send
        ask = builder.plain(f"{name}.keepalive", name, send) if send is not None else None
        return KeptAlive(keepalive, self.lines[name], ask, self.known)

    # -- the verbs

    @property
    def deadline(self) -> float | None:
        """When `tick` must be called at the latest; minus infinity before the first call."""
        if not self._is_begun:
            return float("-inf")
        times = [line.deadline for line in self._all_lines]
        times += [poll.due for poll in self._polls]
        if self._kept_alive:
            times += [one.deadline for one in self._kept_alive.values()]
        if self._runners:
            times += [runner.deadline for runner in self._runners]
        times += (self.readings.deadline, self._verifications.deadline)
        return soonest(times)

    def start(self, transport: str, now: float) -> list[Event]:
        """Take note that `transport` is connected."""
        line = self.lines[transport]
        self._down(line, "the line was connected anew")
        events = line.opened(now)
        greeting = self._greetings.get(transport)
        if greeting is None:
            self._up(line, now)
        else:

            def greeted(outcome: Outcome, now: float) -> list[LineEvent]:
                if outcome.code:
                    return line.give_up(outcome.message, now)
                self._up(line, now)
                return line.ready(now)

            self._begin(Runner(self, greeting, greeted, privileged_on=transport))
        return self._settle(events, now) + self._ask(now)

    def closed(self, transport: str, reason: str, now: float) -> list[Event]:
        """Take note that `transport` is not connected any more, or could not be."""
        line = self.lines[transport]
        events = line.closed(reason, now)
        self._down(line, reason or "the robot hung up")
        return self._settle(events, now)

    def receive(self, transport: str, data: bytes, now: float) -> list[Event]:
        """Take bytes that came in on `transport`."""
        return self._settle(self.lines[transport].receive(data, now), now)

    def command(self, request: Request, now: float) -> list[Event]:
        """Run a command: queued, sent, answered by exactly one `Replied` or `Failed`."""

        def told(outcome: Outcome, now: float) -> list[LineEvent]:
            if outcome.code:
                return [Failed(request.id, request.command, outcome.code, outcome.message)]
            return [Replied(request.id, request.command, outcome.values)]

        return self._settle(self.run(request.command, request.arguments, told, now), now)

    def tick(self, now: float) -> list[Event]:
        """Do everything that is due at `now`."""
        if not self._is_begun:
            self._is_begun = True
            for poll in self._polls:
                if self.lines[poll.poll.transport].is_per_request:
                    poll.begin(now)
        events: list[LineEvent] = []
        for line in self._all_lines:
            events += line.tick(now)
        late = self.readings.tick(now)
        if late:
            events.append(Samples("", tuple(late)))
        for runner in self._runners:
            if runner.deadline is not None and runner.deadline <= now:
                runner.expire(now)
        if self._verifications.deadline is not None:
            events += self._verifications.tick(now)
        told = self._settle(events, now) if events or self._runners else []
        return told + self._ask(now)

    def finish(self, now: float) -> list[Event]:
        """Close every line in good order: each ends with a `Close`, after `GOOD_BYE_S` at most."""
        events: list[LineEvent] = []
        for poll in self._polls:
            poll.stop()
        for line in self.lines.values():
            if line.is_open and not line.is_per_request:
                was_ready = line.is_ready
                self._down(line, "the line is being closed")
                events += line.leave(now) if was_ready else line.shut(now)
        return self._settle(events, now)

    def release(self, command: str) -> bytes:
        """Return the bytes that stop the motion of `command`, framing included.

        Raises:
            BadArgument: it is no motion, or cannot be written.
        """
        found = self._commands.get(command)
        if found is None or found.hold is None:
            raise BadArgument(f"{command!r} is no command with a release")
        values = check_arguments(found, found.hold.release)
        counters = self.lines[found.transport].counters
        names = {**self.known.names, **values, COUNTERS: counters.draw()}
        return self._asks[command].encode(names)

    # -- commands and sequences

    def run(
        self,
        command: str,
        arguments: Mapping[str, object],
        sink: Sink,
        now: float,
        *,
        privileged_on: str = "",
    ) -> list[LineEvent]:
        """Run a command or sequence; its outcome goes to `sink`, exactly once."""
        found = self._commands.get(command)
        if found is None:
            known = ", ".join(self._commands) or "none"
            text = f"there is no command {command!r}; there are: {known}"
            return sink(Outcome("unknown-command", text), now)
        try:
            values = self._checks[command](arguments)
        except BadArgument as error:
            return sink(Outcome("bad-argument", str(error)), now)
        if found.requires:
            why_not = why_not_allowed(found, self.known, values, now)
            if why_not:
                return sink(Outcome("not-allowed", why_not), now)
        program = self._programs.get(command)
        if program is None:
            return self._send(found, values, sink, now, privileged_on)
        if any(runner.program is program for runner in self._runners):
            return sink(Outcome("busy", f"{command} is at work already"), now)
        self._begin(Runner(self, program, sink, privileged_on=privileged_on))
        return []

    def _send(
        self, command: Command, values: Mapping[str, Value], sink: Sink, now: float, on: str
    ) -> list[LineEvent]:
        ask, line = self._asks[command.name], self.lines[command.transport]
        names = {**self.known.names, **values}
        try:
            data = ask.encode({**names, COUNTERS: Counters().draw()} if ask.has_counters else names)
        except BadArgument as error:
            return sink(Outcome("bad-argument", str(error)), now)
        if command.verify is not None and self._verifications.is_full:
            return sink(Outcome("queue-full", "too many commands wait to be verified"), now)
        exchange = Exchange(
            ask,
            CommandRun(command.verify, values, sink, self._verifications),
            names,
            None if ask.has_counters else data,
            gives_up_at=expires_at(line.spec, ask, now),
            is_privileged=on == command.transport,
            condition=partial(why_not_allowed, command, self.known, values)
            if command.requires
            else None,
        )
        return line.submit(exchange, now)

    def _begin(self, runner: Runner) -> None:
        self._runners.append(runner)
        for line in self._all_lines:
            line.is_scripted = True

    # -- what follows from what

    def _settle(self, events: list[LineEvent], now: float) -> list[Event]:
        """Act upon the events meant for the engine; return those meant for the outside."""
        told: list[Event] = []
        pending = events
        while True:
            for event in pending:
                kind = type(event)
                if kind in _PLAIN:
                    told.append(event)  # type: ignore[arg-type]  # these are meant for the outside
                elif kind is Samples:
                    self.known.take(event.samples)  # type: ignore[union-attr]  # they have them
                    self._verifications.has_news = True
                    told.append(event)  # type: ignore[arg-type]  # as above
                else:
                    told += self._outside(event, now)
            pending = self._verifications.look(now) if self._verifications.has_news else []
            if self._runners:
                pending += self._advance(now)
                if any(runner.can_go_on for runner in self._runners):
                    continue
            if pending:
                continue
            for line in self._all_lines:
                if line.is_behind:
                    pending += line.go_on(now)
            if not pending:
                return told

    def _advance(self, now: float) -> list[LineEvent]:
        """Let sequences do steps until they must wait."""
        pending: list[LineEvent] = []
        for runner in tuple(self._runners):
            pending += runner.advance(now)
        self._runners = [runner for runner in self._runners if not runner.is_over]
        if not self._runners:
            for line in self._all_lines:
                line.is_scripted = False
        return pending

    def _outside(self, event: LineEvent, now: float) -> list[Event]:
        if type(event) in _PLAIN:
            return [event]  # type: ignore[list-item]  # these are meant for the outside
        match event:
            case Ended(exchange, outcome):
                inner = exchange.owner.ended(exchange, outcome, now)
                return [told for one in inner for told in self._outside(one, now)] if inner else []
            case Heard(ear, offer):
                if ear.owner is not None:
                    ear.owner.heard(ear, offer, now)
                return []
            case Leaving(transport):
                self._say_good_bye(self.lines[transport], now)
                return []
            case Samples(_, samples):
                self.known.take(samples)
                self._verifications.has_news = True
                return [event]
            case Close(transport, reason):
                self._down(self.lines[transport], reason or "the line was closed")
        return [event]

    def _say_good_bye(self, line: Line, now: float) -> None:
        name = line.spec.name
        runner = Runner(
            self,
            self._good_byes[name],
            lambda outcome, now: line.shut(now) if line.is_open else [],
            privileged_on=name,
        )
        runner.ends_at = now + GOOD_BYE_S
        self._begin(runner)

    def _up(self, line: Line, now: float) -> None:
        name = line.spec.name
        if name in self._kept_alive:
            self._kept_alive[name].forget()
        if not line.is_per_request:
            for poll in self._polls:
                if poll.poll.transport == name:
                    poll.begin(now)

    def _down(self, line: Line, reason: str) -> None:
        """Take note that a connection is over: nothing begun on it may go on upon the next one."""
        name = line.spec.name
        for runner in self._runners:
            uses = name in runner.program.transports and not line.is_per_request
            if uses or runner.privileged_on == name:
                runner.stop("disconnected", reason)
        if not line.is_per_request:
            for poll in self._polls:
                if poll.poll.transport == name:
                    poll.stop()

    def _ask(self, now: float) -> list[Event]:
        """Submit the polls that are due, and what keeps lines alive."""
        told: list[Event] = []
        for poll in self._polls:
            if poll.due is not None and poll.due <= now:
                told += self._settle(poll.ask(now), now)
        for one in self._kept_alive.values() if self._kept_alive else ():
            if one.deadline is not None and one.deadline <= now:

                def run(command: str, one: KeptAlive = one) -> list[LineEvent]:
                    return self.run(command, {}, one.done, now)

                told += self._settle(one.speak(run, now), now)
        return told
