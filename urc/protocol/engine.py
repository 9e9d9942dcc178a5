"""The engine: the synchronous state machine of one driver.

Floor 3, pure: no I/O, no clock, no callback, no task. Whoever owns a transport tells the engine
what happened and when, and performs the events that come back. The live robot, the documents' own
tests, replay and the simulator all use this one engine.

    events = engine.start("wire", now)            # the transport is connected
    events = engine.receive("wire", data, now)    # bytes came in
    events = engine.closed("wire", "why", now)    # it is not connected any more, or never was
    events = engine.command(request, now)         # somebody wants something
    events = engine.tick(now)                     # `engine.deadline` has come

A `Close` among the events means that the engine has forgotten that connection: close it, and do
not report it by `closed`.
"""

from collections.abc import Mapping
from typing import NamedTuple

from urc.model.codec import ReadSpec
from urc.model.driver import Command, Driver, Poll
from urc.model.values import Signal, Value
from urc.protocol.decode import build_decode
from urc.protocol.encode import BadArgument, Encode, build_encode, check_arguments
from urc.protocol.events import Event, Failed, Fault, Request
from urc.protocol.exchange import Exchange, Line, Matcher
from urc.protocol.forms import CodecContext, build_reader

__all__ = ["Engine"]


class _CompiledPoll:
    __slots__ = ("due", "encode", "matcher", "poll")

    def __init__(self, poll: Poll, encode: Encode, matcher: Matcher | None) -> None:
        self.poll = poll
        self.encode = encode
        self.matcher = matcher
        self.due: float | None = None
        """When it is next asked; None while its line is not up."""


class _CompiledCommand(NamedTuple):
    command: Command
    encode: Encode
    matcher: Matcher | None


class Engine:
    """One driver at work. Not safe to re-enter; every verb returns a list of events.

    Args:
        driver: as loaded; its patterns and templates are compiled already.
        settings: value of every setting of the profile.

    Raises:
        BadArgument: a constant frame contains its own delimiter, or cannot be encoded.
    """

    def __init__(self, driver: Driver, settings: Mapping[str, Value]) -> None:
        self._namespace: dict[str, object] = {"settings": dict(settings)}
        self._lines: dict[str, Line] = {}
        for name, spec in driver.transports.items():
            messages = [one for one in driver.messages.values() if one.transport == name]
            context = CodecContext(spec.encoding)
            matchers = [_matcher(driver.signals, one.read, context) for one in messages]
            self._lines[name] = Line(spec, matchers)
        self._commands = {
            command.name: _CompiledCommand(
                command, self._encoder(command), self._answer_to(command, driver.signals)
            )
            for command in driver.commands.values()
        }
        self._polls = [
            _CompiledPoll(poll, self._encoder(poll), self._answer_to(poll, driver.signals))
            for poll in driver.polls
        ]
        self._is_begun = False

    @property
    def deadline(self) -> float | None:
        """When `tick` must be called at the latest; minus infinity before the first call."""
        if not self._is_begun:
            return float("-inf")
        times = [line.deadline for line in self._lines.values()]
        times += [poll.due for poll in self._polls]
        return min((time for time in times if time is not None), default=None)

    def start(self, transport: str, now: float) -> list[Event]:
        """Take note that `transport` is connected."""
        line = self._lines[transport]
        if not line.is_per_request:
            self._schedule(transport, now)
        events = line.opened(now)
        return events + self._ask(now)

    def closed(self, transport: str, reason: str, now: float) -> list[Event]:
        """Take note that `transport` is not connected any more, or could not be."""
        line = self._lines[transport]
        if not line.is_per_request:
            for poll in self._polls:
                if poll.poll.transport == transport:
                    poll.due = None
        return line.closed(reason, now)

    def receive(self, transport: str, data: bytes, now: float) -> list[Event]:
        """Take bytes that came in on `transport`."""
        return self._lines[transport].receive(data, now)

    def command(self, request: Request, now: float) -> list[Event]:
        """Run a command: queued, sent, answered by exactly one `Replied` or `Failed`."""
        compiled = self._commands.get(request.command)
        if compiled is None:
            known = ", ".join(self._commands) or "none"
            text = f"there is no command {request.command!r}; there are: {known}"
            return [Failed(request.id, request.command, "unknown-command", text)]
        command = compiled.command
        try:
            values = check_arguments(command, request.arguments)
            data = compiled.encode({**self._namespace, **values})
        except BadArgument as error:
            return [Failed(request.id, command.name, "bad-argument", str(error))]
        exchange = self._exchange(command, compiled.matcher, data, command.name, now)
        exchange.request_id = request.id
        return self._lines[command.transport].submit(exchange, now)

    def tick(self, now: float) -> list[Event]:
        """Do everything that is due at `now`."""
        if not self._is_begun:
            self._is_begun = True
            for name, line in self._lines.items():
                if line.is_per_request:
                    self._schedule(name, now)
        events: list[Event] = []
        for line in self._lines.values():
            events += line.tick(now)
        return events + self._ask(now)

    def _schedule(self, transport: str, now: float) -> None:
        for poll in self._polls:
            if poll.poll.transport == transport:
                poll.due = now + poll.poll.phase_s

    def _ask(self, now: float) -> list[Event]:
        """Submit the polls that are due. One that still waits for its turn is not asked twice."""
        events: list[Event] = []
        for index, compiled in enumerate(self._polls):
            if compiled.due is None or compiled.due > now:
                continue
            poll = compiled.poll
            # Kept on its own grid of times, so that polls neither drift nor bunch up after a pause.
            missed = (now - compiled.due) // poll.every_s
            compiled.due += (missed + 1) * poll.every_s
            line = self._lines[poll.transport]
            label = poll.name or f"polls.{index}"
            if line.has(label):
                continue
            try:
                data = compiled.encode(self._namespace)
            except BadArgument as error:
                events.append(Fault(poll.transport, "bad-argument", f"{label}: {error}"))
                continue
            events += line.submit(self._exchange(poll, compiled.matcher, data, label, now), now)
        return events

    def _exchange(
        self, asked: Command | Poll, matcher: Matcher | None, data: bytes, label: str, now: float
    ) -> Exchange:
        timeouts = self._lines[asked.transport].spec.timeouts
        own = asked.reply.timeout_s if asked.reply is not None else None
        reply_s = timeouts.reply_s if own is None else own
        gives_up_at = now + timeouts.connect_s + 2 * reply_s
        errors = asked.reply.errors if asked.reply is not None else ()
        return Exchange(label, data, matcher, errors, reply_s=reply_s, gives_up_at=gives_up_at)

    def _encoder(self, asked: Command | Poll) -> Encode:
        line = self._lines[asked.transport]
        return build_encode(asked.send, line.framing, CodecContext(line.spec.encoding))

    def _answer_to(self, asked: Command | Poll, signals: Mapping[str, Signal]) -> Matcher | None:
        if asked.reply is None:
            return None
        context = CodecContext(self._lines[asked.transport].spec.encoding)
        return _matcher(signals, asked.reply.read, context)


def _matcher(signals: Mapping[str, Signal], read: ReadSpec, context: CodecContext) -> Matcher:
    return Matcher(build_reader(read, context), build_decode(signals, read.fields))
