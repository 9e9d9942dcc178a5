"""Automatic replies of an emulated robot to every request that the driver declares.

The module does not use sockets or clocks. Each received frame is compared with all requests that
the driver can send on the same transport. Each reply contains plausible values, and is encoded with
the declaration that the driver uses to decode replies. A command argument with the name of a signal
sets that signal.
"""

from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from typing import Final, NamedTuple

from urc.expressions import COUNTERS, ExpressionError, Template
from urc.model.driver import Argument, Command, Driver, FramingSpec, Poll, TransportSpec
from urc.model.payload import Envelope, Payload, ReadSpec, WriteSpec, each_of
from urc.model.sequence import ExpectStep, IfStep, PromptStep, RepeatStep, SendStep, Step
from urc.model.values import NOTHING, Value
from urc.patterns import Pattern, example
from urc.protocol.forms.table import build_reader, build_writer
from urc.protocol.forms.topics import context_of
from urc.protocol.framing.base import Framing, FramingError
from urc.protocol.framing.table import build_framing
from urc.protocol.values.convert import BadValue
from urc.protocol.values.decode import build_raw
from urc.protocol.values.payload import (
    Frame,
    NotWritable,
    PayloadReader,
    PayloadWriter,
)
from urc.simulator.expression_inverse import computed_fields
from urc.simulator.fields import Fields
from urc.simulator.multiline_replies import in_lines
from urc.simulator.reply_echo import (
    correlated,
    guesses,
    is_alike,
    own_fields,
    rule_for,
    typed_arguments,
)
from urc.simulator.values import Values

__all__ = [
    "SimulatedReply",
    "ReceivedRequest",
    "DefaultConnection",
    "DefaultMessage",
    "DefaultResponder",
    "Unanswered",
    "numbered",
]

_ALWAYS_KNOWN: Final = frozenset(("settings", COUNTERS))
_SLOWEST_S: Final = 1.0
_FASTEST_S: Final = 0.1


class Unanswered(Exception):
    """Raised if no reply to a declared request can be built; the message is for people."""


class SimulatedReply(NamedTuple):
    """One reply: a frame, or a prompt without a terminator."""

    spec: ReadSpec
    reader: PayloadReader | None
    framing: Framing
    prompt: Pattern | None = None
    match: Template | None = None
    needed: frozenset[str] = frozenset()
    """Names of the message's internal fields that the driver's acknowledgement uses."""

    def fits(self, fields: Mapping[str, object]) -> bool:
        """Return whether a frame can be encoded from these fields."""
        try:
            return self.reader is not None and self.reader.write(fields) is not None
        except NotWritable:
            return False


class DefaultMessage(NamedTuple):
    """An unsolicited message that the robot sends periodically."""

    every_s: float
    answer: SimulatedReply


class _Request(NamedTuple):
    label: str
    writer: PayloadWriter
    arguments: Mapping[str, Argument]
    answers: tuple[SimulatedReply, ...]
    names: frozenset[str]


class ReceivedRequest(NamedTuple):
    """A received request with its decoded arguments."""

    request: _Request
    arguments: Mapping[str, object]
    frame: Frame


class DefaultResponder:
    """The values and settings of an emulated robot, shared by all connections."""

    def __init__(self, driver: Driver, settings: Mapping[str, Value], values: Values) -> None:
        self.driver = driver
        self.settings = dict(settings)
        self.values = values
        self._raw = {name: build_raw(one) for name, one in driver.signals.items()}

    def line(self, transport: str, framing: Framing, *, talks: bool) -> "DefaultConnection":
        """Return the robot's side of one transport.

        Args:
            transport: name of the transport.
            framing: framing of data sent and received by the robot.
            talks: whether the robot sends unsolicited messages.
        """
        return DefaultConnection(self, self.driver.transports[transport], framing, talks=talks)

    def _raw_of(self, name: str, now_s: float) -> object:
        if name not in self._raw:
            raise BadValue(name)
        return self._raw[name](self.values.of(name, now_s))

    def fields(self, spec: ReadSpec, known: Mapping[str, object], now_s: float) -> Fields:
        """Return the raw fields for a frame: values that were set, otherwise plausible values."""
        numbers: dict[str, object] = {}
        others: dict[str, object] = {}
        for name in spec.fields:
            signal = self.driver.signals.get(name)
            if signal is None or name in spec.sets or name in spec.collects:
                continue
            is_set = name in self.values.chosen
            try:
                raw = self._raw_of(name, now_s)
            except BadValue:
                continue  # this conversion has no inverse
            if not is_set and signal.conversion.polynomial and isinstance(raw, float):
                raw = round(raw)
            is_number = isinstance(raw, (int, float, tuple, list)) or is_set
            (numbers if is_number else others)[name] = raw
        # A document's field `_kind` takes the value of `kind` from the robot's state.
        state = self.values.state
        own: dict[str, object] = {
            name: state[name[1:]]
            for name in spec.fields
            if name.startswith("_") and name[1:] in state
        }
        own |= computed_fields(spec, partial(self._raw_of, now_s=now_s))
        own |= own_fields(spec, known)
        unknown = [name for name in spec.fields if name.startswith("_") and name not in own]
        return Fields(numbers, others, own, tuple(unknown))


class DefaultConnection:
    """The robot's side of one transport."""

    def __init__(
        self, robot: DefaultResponder, spec: TransportSpec, framing: Framing, *, talks: bool
    ) -> None:
        self._robot = robot
        self._spec = spec
        self._framing = framing
        self._context = context_of(spec, robot.settings)
        self.opening, requests = self._script("on_connect", spec.on_connect)
        self._requests = [*requests, *self._declared()]
        self.messages: list[DefaultMessage] = []
        if talks and spec.connection == "persistent":
            self.messages = [
                DefaultMessage(self._period_s(one.read), self.message(one.name))
                for one in robot.driver.messages.values()
                if one.transport == spec.name
            ]

    def greet(self, now_s: float) -> list[Payload]:
        """Return the frames that the robot sends to a new client, or raise `Unanswered`."""
        return [data for one in self.opening for data in self.render(one, now_s)]

    def answer(self, frame: Frame, now_s: float) -> list[Payload] | None:
        """Return the reply to a frame, or None if the driver cannot have sent the frame.

        Raises:
            Unanswered: no reply can be built.
        """
        asked = self.asked(frame)
        if asked is None:
            return None
        self._robot.values.remember(asked.arguments)
        return self.answers(asked, now_s)

    def answers(self, asked: ReceivedRequest, now_s: float) -> list[Payload]:
        """Return the declared replies to a request, or raise `Unanswered`."""
        known, label = asked.arguments, asked.request.label
        try:
            said = [
                data for one in asked.request.answers for data in self.render(one, now_s, known)
            ]
        except Unanswered as problem:
            rule = rule_for(self._robot.driver, self._spec.name, label)
            raise Unanswered(f"{label}: {problem}; {rule}") from None
        return [numbered(data, asked.frame) for data in said]

    def framing_of(self, label: str) -> Framing:
        """Return the framing of the reply to a command or poll."""
        for request in self._requests:
            if request.label == label and request.answers:
                return request.answers[0].framing
        return self._framing

    def message(self, name: str) -> SimulatedReply:
        """Return the encoder of a declared message."""
        message = self._robot.driver.messages[name]
        names = message.acknowledge.names if message.acknowledge is not None else frozenset()
        if message.log is not None:
            level = message.log.level
            names |= message.log.text.names | (level.names if level is not None else frozenset())
        needed = frozenset(one for one in message.read.fields if one.startswith("_")) & names
        return self._answer(message.read)._replace(needed=needed)

    def render(
        self, answer: SimulatedReply, now_s: float, known: Mapping[str, object] = NOTHING
    ) -> list[Payload]:
        """Return the encoded frames of one reply or message; raise `Unanswered` on failure."""
        if answer.prompt is not None:
            return [example(answer.prompt, {}).encode(self._spec.encoding, "replace")]
        if answer.reader is None or self._robot.values.faults.drops(
            (*answer.spec.fields, *answer.spec.sets)
        ):
            return []
        if answer.match is not None:
            known = {**known, **correlated(answer.match, known)}
        fields = self._robot.fields(answer.spec, known, now_s)
        why = "nothing fits"
        for attempt in fields.attempts(answer.fits):
            try:
                payload = answer.reader.write({**dict.fromkeys(answer.needed, 1), **attempt})
                if not isinstance(payload, bytes):
                    return [payload]
                pieces = in_lines(payload, answer.spec.lines, answer.reader, self._spec.encoding)
                return [answer.framing.encode(piece) for piece in pieces]
            except (NotWritable, FramingError) as error:
                why = str(error)
        raise Unanswered(f"no reply can be built as {answer.spec.form}: {why}")

    def asked(self, frame: Frame, label: str = "") -> ReceivedRequest | None:
        """Return the request that produced a frame, and its arguments; prefer exact matches.

        Args:
            frame: the received frame.
            label: command or poll to prefer if several send the same frame; "" for no preference.
        """
        near: ReceivedRequest | None = None
        best: ReceivedRequest | None = None
        for one in self._readings(frame):
            near = near or one
            if not self._gives(one):
                continue
            best = best or one
            if label in ("", best.request.label):
                return best
            # A poll and a command may send the same bytes: either may be meant.
            if one.request.label == label and not (one.request.names or best.request.names):
                return one
        best = best or near
        return best if best is not None and label in ("", best.request.label) else None

    def asked_too(self, frame: Frame, label: str) -> ReceivedRequest | None:
        """Return `frame` as a request of the command `label`, or None.

        Return None if the best match has arguments or a reply. Otherwise, `frame` may belong to
        several commands: a release, a close message and a plain command often share one stop frame.
        """
        best = self.asked(frame)
        if best is None or best.request.names or best.request.answers:
            return None
        for one in self._readings(frame):
            if one.request.label == label and self._gives(one):
                return one
        return None

    def labels(self, frame: Frame) -> set[str]:
        """Return the labels of all requests that encode to this frame.

        If no request encodes to exactly this frame, return the label of the first match.
        """
        found = list(self._readings(frame))
        exact = {one.request.label for one in found if self._gives(one)}
        return exact or {one.request.label for one in found[:1]}

    def _readings(self, frame: Frame) -> Iterator[ReceivedRequest]:
        """Yield all requests that may have produced a frame, requests without arguments first."""
        for request in self._requests:
            found = request.writer.read(frame)
            arguments = None if found is None else typed_arguments(found, request.arguments)
            if arguments is None:
                continue
            for guess in guesses(request.arguments, arguments):
                asked = ReceivedRequest(request, guess, frame)
                if self._gives(asked):
                    yield asked
            yield ReceivedRequest(request, arguments, frame)

    def _gives(self, asked: ReceivedRequest) -> bool:
        """Return whether the request and its arguments encode to exactly the received frame."""
        request, arguments, frame = asked
        if not request.names:
            return True
        namespace = {
            "settings": self._robot.settings,
            COUNTERS: lambda name, low, high: arguments.get(f"seq.{name}", low),
            **arguments,
        }
        try:
            return is_alike(request.writer.write(namespace), frame.payload)
        except (ExpressionError, NotWritable):
            return False

    def _declared(self) -> Iterator[_Request]:
        """Yield all requests of the driver on this transport, requests without arguments first."""
        driver, name = self._robot.driver, self._spec.name
        requests = []
        for command in driver.commands.values():
            if command.steps:
                requests += self._script(command.name, command.steps)[1]
            elif command.transport == name:
                for one in each_of(command.send):
                    asked = command._replace(send=one)
                    requests.append(self._request(command.name, asked, command.arguments))
        for poll in driver.polls:
            if poll.transport == name and not poll.run:
                requests.append(self._request(poll.name, poll, NOTHING))
        keepalive = self._spec.keepalive
        if keepalive is not None and keepalive.send is not None:
            requests.append(self._sent("keepalive", keepalive.send, ()))
        requests += self._script("on_close", self._spec.on_close)[1]
        for message in driver.messages.values():
            if message.transport == name and message.acknowledge is not None:
                requests.append(self._sent(message.name, message.acknowledge, ()))
        yield from sorted(requests, key=lambda one: bool(one.names - _ALWAYS_KNOWN))

    def _request(
        self, label: str, asked: Command | Poll, arguments: Mapping[str, Argument]
    ) -> _Request:
        reply = asked.reply
        answers: list[SimulatedReply] = []
        if reply is not None:
            reads = [reply.read, *(stage.read for stage in reply.stages)]
            answers += [
                self._answer(read, reply.framing, reply.match)
                for read in reads
                if read.form != "silence"
            ]
        return self._sent(label, asked.send, tuple(answers), arguments)

    def _sent(
        self,
        label: str,
        send: WriteSpec,
        answers: tuple[SimulatedReply, ...],
        arguments: Mapping[str, Argument] = NOTHING,
    ) -> _Request:
        writer = build_writer(send, self._context)
        return _Request(label, writer, arguments, answers, send.names)

    def _answer(
        self, read: ReadSpec, framing: FramingSpec | None = None, match: Template | None = None
    ) -> SimulatedReply:
        own = self._framing if framing is None else build_framing(framing).reversed()
        return SimulatedReply(read, build_reader(read, self._context), own, match=match)

    def _script(
        self, label: str, steps: Iterable[Step]
    ) -> tuple[list[SimulatedReply], list[_Request]]:
        """Return the frames that the robot sends before the first request, and all requests."""
        opening: list[SimulatedReply] = []
        requests: list[tuple[WriteSpec, list[SimulatedReply]]] = []
        for step in _main_way(steps):
            if isinstance(step, (SendStep, ExpectStep, PromptStep)):
                if step.transport != self._spec.name:
                    continue
                answers = requests[-1][1] if requests else opening
                if isinstance(step, SendStep):
                    requests.append((step.send, []))
                elif isinstance(step, ExpectStep):
                    answers.append(self._answer(step.read, step.framing))
                else:
                    prompt = ReadSpec("prompt")
                    answers.append(SimulatedReply(prompt, None, self._framing, step.pattern))
        return opening, [self._sent(label, send, tuple(after)) for send, after in requests]

    def _period_s(self, read: ReadSpec) -> float:
        """Return a message period short enough that none of the message's signals becomes stale."""
        signals = self._robot.driver.signals
        ages = [signals[name].stale_after_s for name in read.fields if name in signals]
        return min(_SLOWEST_S, max(_FASTEST_S, min(ages, default=_SLOWEST_S) / 3))


def _main_way(steps: Iterable[Step]) -> Iterator[Step]:
    for step in steps:
        yield step
        if isinstance(step, IfStep):
            yield from _main_way(step.then)
        elif isinstance(step, RepeatStep):
            yield from _main_way(step.body)


def numbered(data: Payload, request: Frame) -> Payload:
    """Return the reply, with its request's identifier if the request has one."""
    asked = request.payload
    if not isinstance(asked, Envelope):
        return data
    number = asked.attributes.get("id")
    if isinstance(data, Envelope) and data.verb == "response":
        return data._replace(attributes={"id": number, **data.attributes})
    if not isinstance(data, bytes):
        return data
    return Envelope("response", {"id": number, "ok": True, "status": 200}, data)
