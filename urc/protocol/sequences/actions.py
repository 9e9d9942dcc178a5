"""Compile the steps of sequences: each `Step` becomes a function for a `SequenceRunner`.

Pure. See `urc.protocol.sequences.sequence_runner` for the theory of operation.
"""

from collections.abc import Iterator, Mapping
from typing import Literal

from urc.expressions import COUNTERS, ExpressionError, Template
from urc.model import sequence
from urc.model.driver import Driver
from urc.model.values import Value
from urc.protocol.events import Samples
from urc.protocol.requests.connection import GOAL
from urc.protocol.requests.encode import BadArgument
from urc.protocol.requests.exchange import CompiledRequest, Exchange, LineEvent, expires_at, untold
from urc.protocol.requests.goal_watch import GoalWatch
from urc.protocol.requests.reply_match import CompiledReply, Expectation, Matcher
from urc.protocol.requests.request_compiler import RequestCompiler
from urc.protocol.sequences.sequence_control import SequenceControl
from urc.protocol.sequences.sequence_runner import Action, CompiledSequence, SequenceRunner
from urc.protocol.values.payload import Frame, NotWritable

__all__ = ["build_program", "programs_of_lines"]


def build_program(
    label: str,
    steps: tuple[sequence.Step, ...],
    transports: frozenset[str],
    builder: RequestCompiler,
) -> CompiledSequence:
    """Compile a sequence."""
    actions = _actions(label, steps, builder)
    return CompiledSequence(label, actions, transports, SequenceControl(len(actions)))


def programs_of_lines(
    driver: Driver, builder: RequestCompiler, key: Literal["on_connect", "on_close"]
) -> dict[str, CompiledSequence]:
    """Compile ``on_connect`` or ``on_close`` of all transports."""
    return {
        name: build_program(f"{name}.{key}", getattr(spec, key), frozenset((name,)), builder)
        for name, spec in driver.transports.items()
        if getattr(spec, key)
    }


def _actions(
    label: str, steps: tuple[sequence.Step, ...], builder: RequestCompiler
) -> tuple[Action, ...]:
    return tuple(_action(f"{label}.{place}", step, builder) for place, step in enumerate(steps))


def _action(label: str, step: sequence.Step, builder: RequestCompiler) -> Action:
    match step:
        case sequence.SendStep():
            return _sending(builder.compile_step(label, step), step)
        case sequence.ExpectStep() | sequence.PromptStep():
            return _expecting(label, step, builder)
        case sequence.WaitStep(seconds):
            return lambda runner, now: _slept(runner, now + seconds)
        case sequence.UntilStep():
            return _awaiting(label, step, builder)
        case sequence.RepeatStep():
            return _repeating(label, step, builder)
        case sequence.RunStep():
            return _running(step)
        case sequence.SetStep():
            return _setting(step)
        case sequence.IfStep():
            then = _actions(f"{label}.then", step.then, builder)
            otherwise = _actions(f"{label}.else", step.otherwise, builder)
            return lambda runner, now: _chosen(runner, now, step.condition, then, otherwise)
        case sequence.FailStep(text):
            return lambda runner, now: _failed(runner, now, text)


def _slept(runner: SequenceRunner, due: float) -> list[LineEvent]:
    runner.sleep(due)
    return []


def _chosen(
    runner: SequenceRunner,
    now: float,
    condition: Template,
    then: tuple[Action, ...],
    otherwise: tuple[Action, ...],
) -> list[LineEvent]:
    holds = runner.host.known.holds(condition, now, runner.variables)
    runner.push(iter(then if holds else otherwise))
    return []


def _awaiting(label: str, step: sequence.UntilStep, builder: RequestCompiler) -> Action:
    otherwise = _otherwise(label, step.otherwise, builder)
    text = step.text or (
        f"{label}: {step.condition.source!r} did not become true within {step.timeout_s:g} s"
    )

    def wait(runner: SequenceRunner, now: float) -> list[LineEvent]:
        runner.wait_for(step.condition, now + step.timeout_s, otherwise, text)
        runner.check_conditions(now)
        return []

    return wait


def _repeating(label: str, step: sequence.RepeatStep, builder: RequestCompiler) -> Action:
    body = _actions(f"{label}.repeat", step.body, builder)
    otherwise = _otherwise(label, step.otherwise, builder)
    until = step.until
    text = step.text or f"{label}: not finished after {step.times} iterations"

    def rounds(is_done: list[bool]) -> Iterator[Action]:
        def look(runner: SequenceRunner, now: float) -> list[LineEvent]:
            if until is not None:
                is_done.append(runner.host.known.holds(until, now, runner.variables))
            return []

        for _ in range(step.times):
            yield from body
            yield look
            if is_done and is_done.pop():
                return
        if until is not None:
            yield _give_up

    def _give_up(runner: SequenceRunner, now: float) -> list[LineEvent]:
        if otherwise is None:
            runner.stop("failed", text)
        else:
            runner.push(iter(otherwise))
        return []

    def repeat(runner: SequenceRunner, now: float) -> list[LineEvent]:
        runner.push(rounds([]))
        return []

    return repeat


def _otherwise(
    label: str, steps: tuple[sequence.Step, ...] | None, builder: RequestCompiler
) -> tuple[Action, ...] | None:
    return None if steps is None else _actions(f"{label}.else", steps, builder)


def _failed(runner: SequenceRunner, now: float, text: Template) -> list[LineEvent]:
    try:
        runner.stop("failed", text.render(runner.names(now)))
    except ExpressionError as error:
        runner.stop("failed", str(error))
    return []


def _sending(ask: CompiledRequest, step: sequence.SendStep) -> Action:
    names = step.send.names - {COUNTERS}
    is_goal = step.send.options.get("verb") == GOAL

    def send(runner: SequenceRunner, now: float) -> list[LineEvent]:
        line = runner.host.lines[step.transport]
        view = runner.names(now)
        namespace = {name: view[name] for name in names if name in view}
        try:
            data = ask.render(namespace)
        except BadArgument as error:
            why = untold(error) if step.is_secret else str(error)
            runner.stop("bad-argument", f"{ask.label}: {why}")
            return []
        exchange = Exchange(
            ask,
            runner,
            namespace,
            data,
            expires_at(ask, now),
        ).mark(
            is_privileged=runner.privileged_on == step.transport,
            is_secret=step.is_secret,
            unless=runner.why_no_goal if is_goal else runner.why_over,
        )
        if is_goal and runner.on_goal is not None:
            exchange.goal = GoalWatch(runner.on_goal)
        runner.wait()
        return line.submit(exchange, now)

    return send


def _expecting(
    label: str, step: sequence.ExpectStep | sequence.PromptStep, builder: RequestCompiler
) -> Action:
    answer = (
        builder.expected(step)
        if isinstance(step, sequence.ExpectStep)
        else _prompted(step, builder)
    )
    otherwise = _otherwise(label, step.otherwise, builder)
    text = step.text or f"{label}: the expected frame did not arrive within {answer.timeout_s:g} s"

    def expect(runner: SequenceRunner, now: float) -> list[LineEvent]:
        line = runner.host.lines[step.transport]
        if not line.is_open:
            runner.stop("disconnected", "the robot is not connected")
            return []
        expectation = Expectation(answer, runner)
        runner.listen(line, expectation, now, now + answer.timeout_s, otherwise, text)
        if isinstance(step, sequence.PromptStep):
            return line.receiver.look_for(step.pattern, expectation)
        return line.listen(expectation, now)

    return expect


def _prompted(step: sequence.PromptStep, builder: RequestCompiler) -> CompiledReply:
    timeout_s = builder.reply_s(step.transport) if step.timeout_s is None else step.timeout_s
    return CompiledReply(Matcher(_Nothing(), lambda fields, now: ([], [])), timeout_s)


class _Nothing:
    """A reader that matches no frame, because a prompt is text outside frames."""

    def read(self, frame: Frame) -> None:
        return None

    def write(self, fields: Mapping[str, object]) -> bytes:
        raise NotWritable("a prompt is not a frame and cannot be written")


def _running(step: sequence.RunStep) -> Action:
    def run(runner: SequenceRunner, now: float) -> list[LineEvent]:
        view = runner.names(now)
        try:
            arguments = {name: _value(one, view) for name, one in step.arguments.items()}
        except ExpressionError as error:
            runner.stop("bad-argument", str(error))
            return []
        runner.wait()
        is_goal = runner.host.may_send_goal(step.command)
        return runner.host.run(
            step.command,
            arguments,
            runner.done,
            now,
            privileged_on=runner.privileged_on,
            confirmed_by=runner.confirmed_by,
            unless=runner.why_no_goal if is_goal else runner.why_over,
            on_goal=runner.on_goal,
        )

    return run


def _setting(step: sequence.SetStep) -> Action:
    def put(runner: SequenceRunner, now: float) -> list[LineEvent]:
        view = runner.names(now)
        try:
            values = {name: _value(one, view) for name, one in step.values.items()}
        except ExpressionError as error:
            runner.stop("failed", str(error))
            return []
        samples, refused = runner.host.readings.set_values(values, now)
        if refused:
            runner.stop("failed", refused[0])
        return [Samples("", tuple(samples))] if samples else []

    return put


def _value(value: Template | Value, names: Mapping[str, object]) -> object:
    return value.evaluate(names) if isinstance(value, Template) else value
