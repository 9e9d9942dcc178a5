"""The emulated robot that needs no rules: it answers whatever the driver declares.

Pure: no socket, no clock. A frame is held against everything that the driver can send on that
line; the answer is made by the same declaration that would read it, out of plausible values. What a
command sets is remembered, where an argument and a signal share a name.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Final, NamedTuple

from urc.expressions import COUNTERS, ExpressionError, Template
from urc.model.codec import ReadSpec, WriteSpec
from urc.model.driver import Argument, Command, Driver, FramingSpec, Poll, TransportSpec
from urc.model.flow import ExpectStep, IfStep, PromptStep, SendStep, Step
from urc.model.values import NOTHING, Reading, Signal, Value
from urc.patterns import Pattern, example
from urc.protocol.convert import BadValue
from urc.protocol.decode import build_converter, build_raw
from urc.protocol.forms import (
    BadText,
    CodecContext,
    Frame,
    NotWritable,
    Reader,
    Writer,
    build_reader,
    build_writer,
)
from urc.protocol.framing import Framing, FramingError, build_framing
from urc.simulator.echo import correlated, own_fields, typed_arguments
from urc.simulator.plausible import plausible

__all__ = ["Answer", "AutoLine", "AutoMessage", "AutoRobot", "Unanswered"]

_ALWAYS_KNOWN: Final = frozenset(("settings", COUNTERS))
_SLOWEST_S: Final = 1.0
_FASTEST_S: Final = 0.1


class Unanswered(Exception):
    """Why a declared request gets no answer, for people."""


class Answer(NamedTuple):
    """One frame that answers a request, or text that nothing ends."""

    spec: ReadSpec
    reader: Reader | None
    framing: Framing
    prompt: Pattern | None = None
    match: Template | None = None

    def fits(self, fields: Mapping[str, object]) -> bool:
        """Return whether there is a frame with these fields."""
        try:
            return self.reader is not None and self.reader.write(fields) is not None
        except NotWritable:
            return False


class AutoMessage(NamedTuple):
    """What the robot says without being asked."""

    every_s: float
    answer: Answer


class _Request(NamedTuple):
    """Something that the driver can send."""

    label: str
    writer: Writer
    arguments: Mapping[str, Argument]
    answers: tuple[Answer, ...]
    names: frozenset[str]


class AutoRobot:
    """What all connections of one emulated robot share: what was set."""

    def __init__(self, driver: Driver, settings: Mapping[str, Value]) -> None:
        self.driver = driver
        self.settings = dict(settings)
        self._set: dict[str, Reading] = {}
        self._raw = {name: build_raw(one) for name, one in driver.signals.items()}

    def line(self, transport: str, framing: Framing, *, talks: bool) -> "AutoLine":
        """Return the robot's side of one transport.

        Args:
            transport: name of it.
            framing: of the robot's side.
            talks: whether messages are sent without being asked.
        """
        return AutoLine(self, self.driver.transports[transport], framing, talks=talks)

    def remember(self, arguments: Mapping[str, object]) -> None:
        """Keep what a command sets."""
        for name, value in arguments.items():
            signal = self.driver.signals.get(name)
            if signal is not None and signal.formula is None and value is not None:
                kept = _kept(signal, value)
                if kept is not None:
                    self._set[name] = kept

    def fields(self, spec: ReadSpec, known: Mapping[str, object], now_s: float) -> "_Fields":
        """Return raw fields for a frame: what was set, else something plausible."""
        numbers: dict[str, object] = {}
        others: dict[str, object] = {}
        for name in spec.fields:
            signal = self.driver.signals.get(name)
            if signal is None or name in spec.sets:
                continue
            is_set = name in self._set
            value = self._set[name] if is_set else plausible(signal, now_s)
            try:
                raw = self._raw[name](value)
            except BadValue:
                continue  # this conversion has no way back
            if not is_set and signal.conversion.polynomial and isinstance(raw, float):
                raw = round(raw)
            is_number = isinstance(raw, (int, float, tuple, list)) or is_set
            (numbers if is_number else others)[name] = raw
        own = own_fields(spec, known)
        for name, template in spec.sets.items():
            if len(template.names) == 1 and name in self.driver.signals:
                # Most expressions of one field only turn its text into a number.
                value = self._set.get(name, plausible(self.driver.signals[name], now_s))
                own.setdefault(next(iter(template.names)), value)
        return _Fields(numbers, others, own)


class _Fields(NamedTuple):
    numbers: dict[str, object]
    others: dict[str, object]
    own: dict[str, object]
    """Those of the document: constants of ``when``, and what correlates with the request."""

    def attempts(self, fits: Callable[[dict[str, object]], bool]) -> Iterator[dict[str, object]]:
        """Yield fields to write, from all to the least; the frame decides what it can carry."""
        whole = {name: _rounded(raw) for name, raw in self.numbers.items()}
        yield self.numbers | self.others | self.own
        yield whole | self.others | self.own
        # Some exclude each other: one by one, as long as there is a frame with all of them.
        most = dict(self.own)
        for name, raw in (self.numbers | self.others).items():
            for value in (raw, whole.get(name, raw)):
                if name not in most and fits(most | {name: value}):
                    most[name] = value
        yield most
        yield self.own


class AutoLine:
    """The robot's side of one transport."""

    def __init__(
        self, robot: AutoRobot, spec: TransportSpec, framing: Framing, *, talks: bool
    ) -> None:
        """Made by `AutoRobot.line`."""
        self._robot = robot
        self._spec = spec
        self._framing = framing
        self._context = CodecContext(spec.encoding, robot.settings)
        self.opening, requests = self._script("on_connect", spec.on_connect)
        self._requests = [*requests, *self._declared()]
        self.messages: list[AutoMessage] = []
        if talks and spec.connection == "persistent":
            self.messages = [
                AutoMessage(self._period_s(one.read), self._answer(one.read))
                for one in robot.driver.messages.values()
                if one.transport == spec.name
            ]

    def greet(self, now_s: float) -> list[bytes]:
        """Return what the robot says as soon as somebody is there; raise `Unanswered`."""
        return [data for one in self.opening for data in self.say(one, now_s)]

    def answer(self, frame: Frame, now_s: float) -> list[bytes] | None:
        """Return the answer to a frame, or None when the driver never sends it.

        Raises:
            Unanswered: the answer cannot be made.
        """
        found = self._recognise(frame)
        if found is None:
            return None
        request, arguments = found
        self._robot.remember(arguments)
        return [data for one in request.answers for data in self.say(one, now_s, arguments)]

    def say(
        self, answer: Answer, now_s: float, known: Mapping[str, object] = NOTHING
    ) -> list[bytes]:
        """Return the frames of one answer or message; raise `Unanswered`."""
        if answer.prompt is not None:
            return [example(answer.prompt, {}).encode(self._spec.encoding, "replace")]
        if answer.reader is None:
            return []
        if answer.match is not None:
            known = {**known, **correlated(answer.match, known)}
        fields = self._robot.fields(answer.spec, known, now_s)
        why = "nothing fits"
        for attempt in fields.attempts(answer.fits):
            try:
                payload = answer.reader.write(attempt)
                if isinstance(payload, bytes):
                    pieces = _in_lines(payload, answer, self._spec.encoding)
                    return [answer.framing.encode(piece) for piece in pieces]
                why = "a message cannot go over a line of bytes"
            except (NotWritable, FramingError) as error:
                why = str(error)
        raise Unanswered(f"no answer can be made by its {answer.spec.form}: {why}")

    def _recognise(self, frame: Frame) -> tuple[_Request, dict[str, object]] | None:
        """Return what the frame asks, and its arguments; what gives this very frame goes first."""
        near: tuple[_Request, dict[str, object]] | None = None
        for request in self._requests:
            found = request.writer.read(frame)
            arguments = None if found is None else typed_arguments(found, request.arguments)
            if arguments is None:
                continue
            if not request.names or self._gives(request, arguments, frame):
                return request, arguments
            near = near or (request, arguments)
        return near

    def _gives(self, request: _Request, arguments: Mapping[str, object], frame: Frame) -> bool:
        namespace = {
            "settings": self._robot.settings,
            COUNTERS: lambda name, low, high: arguments.get(f"seq.{name}", low),
            **arguments,
        }
        try:
            return request.writer.write(namespace) == frame.payload
        except (ExpressionError, NotWritable):
            return False

    def _declared(self) -> Iterator[_Request]:
        """Yield what commands, polls and sequences send on this line; constants first."""
        driver, name = self._robot.driver, self._spec.name
        requests = []
        for command in driver.commands.values():
            if command.steps:
                requests += self._script(command.name, command.steps)[1]
            elif command.transport == name:
                requests.append(self._request(command.name, command, command.arguments))
        for poll in driver.polls:
            if poll.transport == name and not poll.run:
                requests.append(self._request(poll.name, poll, NOTHING))
        keepalive = self._spec.keepalive
        if keepalive is not None and keepalive.send is not None:
            requests.append(self._sent("keepalive", keepalive.send, ()))
        requests += self._script("on_close", self._spec.on_close)[1]
        yield from sorted(requests, key=lambda one: bool(one.names - _ALWAYS_KNOWN))

    def _request(
        self, label: str, asked: Command | Poll, arguments: Mapping[str, Argument]
    ) -> _Request:
        reply = asked.reply
        answers: list[Answer] = []
        if reply is not None:
            answers.append(self._answer(reply.read, reply.framing, reply.match))
            answers += [
                self._answer(stage.read, reply.framing, reply.match) for stage in reply.stages
            ]
        return self._sent(label, asked.send, tuple(answers), arguments)

    def _sent(
        self,
        label: str,
        send: WriteSpec,
        answers: tuple[Answer, ...],
        arguments: Mapping[str, Argument] = NOTHING,
    ) -> _Request:
        writer = build_writer(send, self._context)
        return _Request(label, writer, arguments, answers, send.names)

    def _answer(
        self, read: ReadSpec, framing: FramingSpec | None = None, match: Template | None = None
    ) -> Answer:
        own = self._framing if framing is None else build_framing(framing).reversed()
        return Answer(read, build_reader(read, self._context), own, match=match)

    def _script(self, label: str, steps: Iterable[Step]) -> tuple[list[Answer], list[_Request]]:
        """Return what is expected before anything is sent, and what is after each thing sent."""
        opening: list[Answer] = []
        requests: list[tuple[WriteSpec, list[Answer]]] = []
        for step in _main_way(steps):
            if isinstance(step, (SendStep, ExpectStep, PromptStep)):
                if step.transport != self._spec.name:
                    continue
                answers = requests[-1][1] if requests else opening
                if isinstance(step, SendStep):
                    requests.append((step.send, []))
                elif isinstance(step, ExpectStep):
                    answers.append(self._answer(step.read))
                else:
                    prompt = ReadSpec("prompt")
                    answers.append(Answer(prompt, None, self._framing, step.pattern))
        return opening, [self._sent(label, send, tuple(after)) for send, after in requests]

    def _period_s(self, read: ReadSpec) -> float:
        """Return how often a message is said, so that none of its signals grows old."""
        signals = self._robot.driver.signals
        ages = [signals[name].stale_after_s for name in read.fields if name in signals]
        return min(_SLOWEST_S, max(_FASTEST_S, min(ages, default=_SLOWEST_S) / 3))


def _main_way(steps: Iterable[Step]) -> Iterator[Step]:
    for step in steps:
        yield step
        if isinstance(step, IfStep):
            yield from _main_way(step.then)


def _kept(signal: Signal, value: object) -> Reading:
    """Return what `signal` is once a command has set it to `value`, or None."""
    words = dict(signal.states)
    if words:
        word = str(value)
        return word if word in words.values() else words.get(word)
    plain = signal._replace(conversion=signal.conversion._replace(polynomial=(), points=(), base=0))
    try:
        return build_converter(plain)(value)
    except BadValue:
        return None


def _rounded(raw: object) -> object:
    if isinstance(raw, float):
        return round(raw)
    if isinstance(raw, (list, tuple)):
        return [_rounded(one) for one in raw]
    return raw


def _in_lines(payload: bytes, answer: Answer, encoding: str) -> list[bytes]:
    """Return the frames of an answer, which may be several lines."""
    lines = answer.spec.lines
    if lines is None:
        return [payload]
    pieces = payload.split(b"\n")
    if isinstance(lines, int):
        return pieces + [b""] * (lines - len(pieces))
    end = example(lines, {}).encode(encoding, "replace")
    if answer.reader is None or _ends(pieces[-1], lines, encoding):
        return pieces
    # What the form itself has in its last line goes before a line of our own.
    replaced = [*pieces[:-1], end]
    is_read = answer.reader.read(Frame(b"\n".join(replaced), encoding)) is not None
    return replaced if is_read and len(pieces) > 1 else [*pieces, end]


def _ends(line: bytes, until: Pattern, encoding: str) -> bool:
    try:
        return until.search(Frame(line, encoding).text) is not None
    except BadText:
        return False
