"""Sequences at work: ordered steps on the lines of one engine.

Floor 3, pure. Each step becomes a function when the engine is built; a `Runner` calls them one
after the other until one must wait: for an answer, a frame, a prompt, or time. Whoever owns the
engine's verbs settles what comes of it and calls `advance` again. There are no loops, and every
wait has an end, so every sequence has one.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple, Protocol

from urc.expressions import COUNTERS, ExpressionError, Template
from urc.model.flow import (
    ExpectStep,
    FailStep,
    IfStep,
    PromptStep,
    RunStep,
    SendStep,
    SetStep,
    Step,
    WaitStep,
)
from urc.model.values import Value
from urc.protocol.asking import Builder
from urc.protocol.encode import BadArgument
from urc.protocol.events import Samples
from urc.protocol.exchange import (
    DONE,
    Answer,
    Ask,
    Ear,
    Exchange,
    LineEvent,
    Matcher,
    Offer,
    Outcome,
    expires_at,
)
from urc.protocol.forms import Frame, NotWritable
from urc.protocol.gate import Counters
from urc.protocol.known import Known
from urc.protocol.line import Line
from urc.protocol.readings import Readings

__all__ = ["Action", "Host", "Program", "Runner", "Sink", "build_program"]

Sink = Callable[[Outcome, float], list[LineEvent]]
"""Takes the outcome and the time; returns what to tell."""


class Host(Protocol):
    """What a sequence needs of its engine."""

    lines: Mapping[str, Line]
    known: Known
    readings: Readings

    def run(
        self,
        command: str,
        arguments: Mapping[str, object],
        sink: Sink,
        now: float,
        *,
        privileged_on: str,
    ) -> list[LineEvent]:
        """Run a command or sequence; its outcome goes to `sink`."""


Action = Callable[["Runner", float], list[LineEvent]]
"""One step, compiled."""


class Program(NamedTuple):
    """A sequence, compiled."""

    label: str
    actions: tuple[Action, ...]
    transports: frozenset[str]
    """Lines that it talks on by itself."""


class Runner:
    """One sequence at work."""

    def __init__(
        self, host: Host, program: Program, sink: Sink, *, privileged_on: str = ""
    ) -> None:
        """Prepare to run.

        Args:
            host: the engine.
            program: what to do.
            sink: takes the outcome, once.
            privileged_on: line whose connection this sequence makes usable or ends; "" for none.
        """
        self.host = host
        self.program = program
        self.privileged_on = privileged_on
        self.variables: dict[str, object] = {}
        """What the robot said, by ``_field``."""
        self.due: float | None = None
        """When the present wait ends."""
        self.ends_at: float | None = None
        """When all of it ends, done or not."""
        self.is_waiting = False
        self._sink: Sink | None = sink
        self._outcome: Outcome | None = None
        self._stack: list[Iterator[Action]] = [iter(program.actions)]
        self._listening: tuple[Line, Ear] | None = None
        self._otherwise: tuple[Action, ...] | None = None
        self._late_text = ""

    @property
    def is_over(self) -> bool:
        """Whether its outcome has been told."""
        return self._sink is None

    @property
    def can_go_on(self) -> bool:
        """Whether `advance` has something to do."""
        return not self.is_over and (self._outcome is not None or not self.is_waiting)

    @property
    def deadline(self) -> float | None:
        """When `expire` must be called."""
        if self.due is None or self.ends_at is None:
            return self.ends_at if self.due is None else self.due
        return min(self.due, self.ends_at)

    def advance(self, now: float) -> list[LineEvent]:
        """Do steps until one must wait or all are done."""
        events: list[LineEvent] = []
        while self._outcome is None and not self.is_waiting:
            action = next(self._stack[-1], None) if self._stack else None
            if action is not None:
                events += action(self, now)
            elif self._stack:
                self._stack.pop()
            else:
                self._outcome = DONE
        if self._outcome is not None and self._sink is not None:
            sink, self._sink = self._sink, None
            events += sink(self._outcome, now)
        return events

    def expire(self, now: float) -> None:
        """Take note that the wait has ended by itself."""
        if self.ends_at is not None and self.ends_at <= now:
            self.stop("timed-out", "it took too long")
            return
        if self._listening is None:
            self._resume()
            return
        self._stop_listening()
        if self._otherwise is None:
            self.stop("timed-out", self._late_text)
            return
        self._stack.append(iter(self._otherwise))
        self._resume()

    def stop(self, code: str, reason: str) -> None:
        """End without success."""
        self._stop_listening()
        if self._outcome is None:
            self._outcome = Outcome(code, reason)

    # -- told by the engine

    def ended(self, exchange: Exchange, outcome: Outcome, now: float) -> list[LineEvent]:
        """Take note that what a step sent is sent, or cannot be."""
        return self.done(outcome, now)

    def done(self, outcome: Outcome, now: float) -> list[LineEvent]:
        """Take note of the outcome of what a step has begun."""
        if outcome.code:
            self.stop(outcome.code, outcome.message)
        self.variables |= {f"_{name}": value for name, value in outcome.values.items()}
        self._resume()
        return []

    def heard(self, ear: Ear, offer: Offer, now: float) -> None:
        """Take what was waited for."""
        self._listening = None
        if offer.refusal:
            self.stop("refused", offer.refusal)
            return
        fields = offer.fields or {}
        self.variables |= {name: raw for name, raw in fields.items() if name.startswith("_")}
        self._resume()

    # -- for actions

    def names(self, now: float) -> Mapping[str, object]:
        """Return the namespace of its expressions."""
        return self.host.known.view(now, self.variables)

    def push(self, actions: tuple[Action, ...]) -> None:
        """Do these next."""
        self._stack.append(iter(actions))

    def sleep(self, due: float) -> None:
        """Wait until `due`."""
        self.is_waiting, self.due = True, due

    def begin(self) -> None:
        """Wait until `done` is called."""
        self.is_waiting = True

    def listen(
        self, line: Line, ear: Ear, due: float, otherwise: tuple[Action, ...] | None, text: str
    ) -> None:
        """Wait for what `ear` hears."""
        self._listening = (line, ear)
        self._otherwise, self._late_text = otherwise, text
        self.sleep(due)

    def _resume(self) -> None:
        self.is_waiting, self.due = False, None

    def _stop_listening(self) -> None:
        if self._listening is not None:
            line, ear = self._listening
            line.inbox.unlisten(ear)
            self._listening = None


def build_program(
    label: str, steps: tuple[Step, ...], transports: frozenset[str], builder: Builder
) -> Program:
    """Compile a sequence."""
    return Program(label, _actions(label, steps, builder), transports)


def _actions(label: str, steps: tuple[Step, ...], builder: Builder) -> tuple[Action, ...]:
    return tuple(_action(f"{label}.{place}", step, builder) for place, step in enumerate(steps))


def _action(label: str, step: Step, builder: Builder) -> Action:
    match step:
        case SendStep():
            return _sending(builder.step(label, step), step)
        case ExpectStep() | PromptStep():
            return _expecting(label, step, builder)
        case WaitStep(seconds):
            return lambda runner, now: _slept(runner, now + seconds)
        case RunStep():
            return _running(step)
        case SetStep():
            return _setting(step)
        case IfStep():
            then = _actions(f"{label}.then", step.then, builder)
            otherwise = _actions(f"{label}.else", step.otherwise, builder)
            return lambda runner, now: _chosen(runner, now, step.condition, then, otherwise)
        case FailStep(text):
            return lambda runner, now: _failed(runner, now, text)


def _slept(runner: Runner, due: float) -> list[LineEvent]:
    runner.sleep(due)
    return []


def _chosen(
    runner: Runner,
    now: float,
    condition: Template,
    then: tuple[Action, ...],
    otherwise: tuple[Action, ...],
) -> list[LineEvent]:
    holds = runner.host.known.holds(condition, now, runner.variables)
    runner.push(then if holds else otherwise)
    return []


def _failed(runner: Runner, now: float, text: Template) -> list[LineEvent]:
    try:
        runner.stop("failed", text.render(runner.names(now)))
    except ExpressionError as error:
        runner.stop("failed", str(error))
    return []


def _sending(ask: Ask, step: SendStep) -> Action:
    names = step.send.names - {COUNTERS}

    def send(runner: Runner, now: float) -> list[LineEvent]:
        line = runner.host.lines[step.transport]
        view = runner.names(now)
        namespace = {name: view[name] for name in names if name in view}
        try:
            data = ask.encode({**namespace, COUNTERS: Counters().draw()})
        except BadArgument as error:
            why = "it cannot be written with what is known" if step.is_secret else str(error)
            runner.stop("bad-argument", f"{ask.label}: {why}")
            return []
        exchange = Exchange(
            ask,
            runner,
            namespace,
            None if ask.has_counters else data,
            gives_up_at=expires_at(line.spec, ask, now),
            is_privileged=runner.privileged_on == step.transport,
            is_secret=step.is_secret,
        )
        runner.begin()
        return line.submit(exchange, now)

    return send


def _expecting(label: str, step: ExpectStep | PromptStep, builder: Builder) -> Action:
    answer = builder.expected(step) if isinstance(step, ExpectStep) else _prompted(step, builder)
    otherwise = (
        None if step.otherwise is None else _actions(f"{label}.else", step.otherwise, builder)
    )
    text = step.text or f"{label}: what it expects did not come within {answer.timeout_s:g} s"

    def expect(runner: Runner, now: float) -> list[LineEvent]:
        line = runner.host.lines[step.transport]
        if not line.is_open:
            runner.stop("disconnected", "the robot is not connected")
            return []
        ear = Ear(answer, runner)
        runner.listen(line, ear, now + answer.timeout_s, otherwise, text)
        if isinstance(step, PromptStep):
            return line.inbox.look_for(step.pattern, ear)
        line.inbox.listen(ear)
        return []

    return expect


def _prompted(step: PromptStep, builder: Builder) -> Answer:
    timeout_s = builder.reply_s(step.transport) if step.timeout_s is None else step.timeout_s
    return Answer(Matcher(_Nothing(), lambda fields, now: ([], [])), timeout_s)


class _Nothing:
    """Reads no frame: a prompt is none."""

    def read(self, frame: Frame) -> None:
        return None

    def write(self, fields: Mapping[str, object]) -> bytes:
        raise NotWritable("a prompt is no frame")


def _running(step: RunStep) -> Action:
    def run(runner: Runner, now: float) -> list[LineEvent]:
        view = runner.names(now)
        try:
            arguments = {name: _value(one, view) for name, one in step.arguments.items()}
        except ExpressionError as error:
            runner.stop("bad-argument", str(error))
            return []
        runner.begin()
        on = runner.privileged_on
        return runner.host.run(step.command, arguments, runner.done, now, privileged_on=on)

    return run


def _setting(step: SetStep) -> Action:
    def put(runner: Runner, now: float) -> list[LineEvent]:
        view = runner.names(now)
        try:
            values = {name: _value(one, view) for name, one in step.values.items()}
        except ExpressionError as error:
            runner.stop("failed", str(error))
            return []
        samples, refused = runner.host.readings.put(values, now)
        if refused:
            runner.stop("failed", refused[0])
        return [Samples("", tuple(samples))] if samples else []

    return put


def _value(value: Template | Value, names: Mapping[str, object]) -> object:
    return value.evaluate(names) if isinstance(value, Template) else value
