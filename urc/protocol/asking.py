"""From what a driver declares to what can be asked: built once, when an engine is.

Floor 3, pure.
"""

from collections.abc import Mapping
from functools import partial

from urc.expressions import COUNTERS
from urc.model.codec import Payload, ReadSpec, WriteSpec
from urc.model.driver import Argument, Command, Driver, Poll, Reply
from urc.model.flow import ErrorReply, ExpectStep, SendStep, Stage
from urc.model.values import NOTHING
from urc.patterns import Pattern
from urc.protocol.encode import build_encode
from urc.protocol.exchange import Answer, Ask, Matcher
from urc.protocol.fast_read import Taken, build_fast_read, prefix_of
from urc.protocol.forms import CodecContext, Frame, build_reader
from urc.protocol.framing import build_framing
from urc.protocol.gate import RANKS, Bucket
from urc.protocol.line import Line
from urc.protocol.readings import Readings

__all__ = ["Builder"]


class Builder:
    """Compiles the requests of one driver.

    Raises:
        BadArgument: from every method, when a constant frame contains its own delimiter or cannot
            be encoded.
    """

    def __init__(self, driver: Driver, readings: Readings) -> None:
        self._readings = readings
        self.lines: dict[str, Line] = {}
        for name, spec in driver.transports.items():
            messages = [one.read for one in driver.messages.values() if one.transport == name]
            context = CodecContext(spec.encoding, self._readings.settings)
            self.lines[name] = Line(spec, [self._message(read, context) for read in messages])

    def command(self, command: Command) -> Ask:
        """Return what a command asks."""
        ask = self._ask(
            command.name, command.transport, command.send, command.reply, command.arguments
        )
        return ask._replace(
            rank=RANKS[command.priority],
            is_latest_only=command.is_latest_only,
            bucket=Bucket(command.rate_per_s) if command.rate_per_s else None,
            retries=command.retries if command.is_idempotent else 0,
            is_motion=command.hold is not None,
        )

    def poll(self, poll: Poll, label: str) -> Ask:
        """Return what a poll asks."""
        ask = self._ask(label, poll.transport, poll.send, poll.reply)
        return ask._replace(rank=RANKS[poll.priority], is_miss_harmless=poll.offline is not None)

    def plain(self, label: str, transport: str, send: WriteSpec) -> Ask:
        """Return a frame that nothing answers."""
        return self._ask(label, transport, send, None)

    def step(self, label: str, step: SendStep) -> Ask:
        """Return what a step sends; nothing passes it."""
        return self.plain(label, step.transport, step.send)._replace(rank=RANKS["normal"])

    def expected(self, step: ExpectStep) -> Answer:
        """Return what a step waits for."""
        return self._answer(step.transport, step.read, step.errors, step.faults, step.timeout_s)

    def reply_s(self, transport: str) -> float:
        """Return how long an answer may take where nothing else is said."""
        return self.lines[transport].spec.timeouts.reply_s

    def _ask(
        self,
        label: str,
        transport: str,
        send: WriteSpec,
        reply: Reply | None,
        arguments: Mapping[str, Argument] = NOTHING,
    ) -> Ask:
        line = self.lines[transport]
        context = CodecContext(line.spec.encoding, self._readings.settings)
        encode = build_encode(send, line.framing, context, arguments)
        has_counters = COUNTERS in send.names
        if reply is None:
            return Ask(label, encode, has_counters=has_counters)
        stages = (
            Stage(reply.read, reply.errors, reply.faults, reply.timeout_s),
            *reply.stages,
        )
        return Ask(
            label,
            encode,
            tuple(
                self._answer(transport, one.read, one.errors, one.faults, one.timeout_s)
                for one in stages
            ),
            match=reply.match,
            framing=None if reply.framing is None else build_framing(reply.framing),
            has_counters=has_counters,
        )

    def _answer(
        self,
        transport: str,
        read: ReadSpec,
        errors: tuple[Pattern, ...],
        faults: tuple[ErrorReply, ...],
        timeout_s: float | None,
    ) -> Answer:
        spec = self.lines[transport].spec
        context = CodecContext(spec.encoding, self._readings.settings)
        return Answer(
            self._matcher(read, context),
            spec.timeouts.reply_s if timeout_s is None else timeout_s,
            errors,
            tuple((self._matcher(one.read, context), one.text) for one in faults),
            read.lines,
        )

    def _message(self, read: ReadSpec, context: CodecContext) -> Matcher:
        matcher = self._matcher(read, context)

        def slow(payload: Payload, now: float) -> Taken | None:
            return matcher.take(Frame(payload, context.encoding), now)

        make_fast = partial(build_fast_read, read, matcher.reader, self._readings, slow)
        return matcher._replace(make_fast=make_fast, prefix=prefix_of(read))

    def _matcher(self, read: ReadSpec, context: CodecContext) -> Matcher:
        return Matcher(build_reader(read, context), self._readings.decoder(read.fields))
