"""What a command involves: how long it may take at most, and over which lines.

Every wait of an engine has an end, and here they are added up.

Floor 3, pure.
"""

from collections.abc import Callable, Mapping
from typing import Final

from urc.model.driver import Command, Driver, Reply, TransportSpec
from urc.model.flow import RESENDS, Asides
from urc.model.sequence import (
    ExpectStep,
    IfStep,
    PromptStep,
    RepeatStep,
    RunStep,
    SendStep,
    Step,
    UntilStep,
    WaitStep,
    all_steps,
)

__all__ = ["GOOD_BYE_S", "calm_s", "lines_of", "longest_s", "needs_readings", "queue_limit_s"]

GOOD_BYE_S: Final = 2.0
"""What ``on_close`` may take in all."""


def queue_limit_s(spec: TransportSpec, reply_s: float | None) -> float:
    """Return how long a request may wait to be sent.

    Args:
        spec: the line.
        reply_s: how long its first answer may take; None when nothing answers it.
    """
    answer_s = spec.timeouts.reply_s if reply_s is None else reply_s
    steps_s = _steps_s(spec.on_connect, lambda step: _step_s(step, spec))
    if spec.timeouts.on_connect_s is not None:
        steps_s = min(steps_s, spec.timeouts.on_connect_s)
    return spec.timeouts.connect_s + 2 * answer_s + steps_s


def longest_s(driver: Driver, name: str) -> float:
    """Return the time in which the command or sequence `name` is over, whatever happens."""
    command = driver.commands.get(name)
    return 0.0 if command is None else _command_s(command, driver, frozenset())


def calm_s(driver: Driver) -> float:
    """Return how near a deadline may be that a frame or a command makes, or 0 if it may be at once.

    Answers, polls and silent lines make some. Sequences are not looked at, nor is what a framing
    waits for.
    """
    if any(one.verify or one.rate_per_s for one in driver.commands.values()):
        return 0.0
    if any(one.limits.for_s or one.deadband or one.debounce_s for one in driver.signals.values()):
        return 0.0
    if any(spec.keepalive or spec.min_gap_s for spec in driver.transports.values()):
        return 0.0  # a gap may be nearly over when the next one comes
    waits = [poll.every_s for poll in driver.polls]
    for spec in driver.transports.values():
        waits += [spec.timeouts.reply_s, *filter(None, (spec.stale_after_s,))]
    replies = [one.reply for one in driver.commands.values()]
    replies += [one.reply for one in driver.polls]
    for reply in replies:
        if reply is None:
            continue
        times = (reply.timeout_s, *(stage.timeout_s for stage in reply.stages))
        waits += [time for time in times if time is not None]
        if reply.framing is not None:
            return 0.0  # it may have waits of its own
    return min(waits, default=0.0)


def _command_s(command: Command, driver: Driver, outer: frozenset[str]) -> float:
    if command.name in outer:
        return 0.0  # no sequence runs itself; whoever builds one by hand gets no endless loop
    within_s = command.verify.within_s if command.verify is not None else 0.0
    if not command.steps:
        return _exchange_s(command, driver.transports[command.transport]) + within_s
    outer |= {command.name}

    def one_s(step: Step) -> float:
        if isinstance(step, RunStep):
            inner = driver.commands.get(step.command)
            return _command_s(inner, driver, outer) if inner is not None else 0.0
        return _step_s(step, _line_of(step, driver.transports))

    return within_s + _steps_s(command.steps, one_s)


def _steps_s(steps: tuple[Step, ...], one_s: Callable[[Step], float]) -> float:
    """Return the longest time of `steps`, every round of a loop and both ways of a choice."""
    total_s = 0.0
    for step in steps:
        total_s += one_s(step)
        if isinstance(step, RepeatStep):
            total_s += step.times * _steps_s(step.body, one_s)
        if isinstance(step, IfStep):
            total_s += _steps_s(step.then, one_s)
        if isinstance(step, (ExpectStep, IfStep, PromptStep, RepeatStep, UntilStep)):
            total_s += _steps_s(step.otherwise or (), one_s)
    return total_s


def _exchange_s(command: Command, spec: TransportSpec) -> float:
    reply = command.reply
    if reply is None:
        return queue_limit_s(spec, None)
    first_s = _answer_s(reply.timeout_s, spec, reply.asides)
    once_s = queue_limit_s(spec, first_s) + first_s
    waits_s = sum(command.retry.wait_s(tries + 1) for tries in range(command.retries))
    times = 1 + (command.retries or RESENDS * reply.is_asked_again)
    # A request that is asked for again begins at its first answer.
    stages_s = _stages_s(reply, spec) * (times if reply.is_asked_again else 1)
    return times * once_s + waits_s + stages_s


def _stages_s(reply: Reply, spec: TransportSpec) -> float:
    return sum(_answer_s(one.timeout_s, spec, one.asides) for one in reply.stages)


def _answer_s(timeout_s: float | None, spec: TransportSpec, asides: Asides) -> float:
    busy_s = asides.extend_s if asides.extend is not None else 0.0
    return max(spec.timeouts.reply_s if timeout_s is None else timeout_s, busy_s)


def _line_of(step: Step, transports: Mapping[str, TransportSpec]) -> TransportSpec | None:
    if isinstance(step, (SendStep, ExpectStep, PromptStep)):
        return transports[step.transport]
    return None


def _step_s(step: Step, spec: TransportSpec | None) -> float:
    """Return the longest time of one step, its branches and what it runs aside."""
    if isinstance(step, WaitStep):
        return step.seconds
    if isinstance(step, UntilStep):
        return step.timeout_s
    if spec is None:
        return 0.0
    if isinstance(step, SendStep):
        return spec.timeouts.connect_s + 2 * spec.timeouts.reply_s
    if isinstance(step, (ExpectStep, PromptStep)):
        return _answer_s(step.timeout_s, spec, Asides())
    return 0.0


def lines_of(name: str, driver: Driver) -> frozenset[str]:
    """Return the lines that a sequence talks on by itself, those of nested ones included."""
    found: set[str] = set()
    names, seen = [name], set[str]()
    while names:
        command = driver.commands.get(names.pop())
        if command is None or command.name in seen:
            continue
        seen.add(command.name)
        for step in all_steps(command.steps):
            if isinstance(step, (SendStep, ExpectStep, PromptStep)):
                found.add(step.transport)
            elif isinstance(step, RunStep):
                names.append(step.command)
        if not command.steps:
            found.add(command.transport)
    return frozenset(found)


def needs_readings(driver: Driver) -> bool:
    """Return whether anything in a driver depends on what was read before."""
    specs = driver.transports.values()
    return (
        any(
            one.requires or one.verify or one.steps or one.confirm
            for one in driver.commands.values()
        )
        or any(poll.when is not None for poll in driver.polls)
        or any(one.answer is not None for one in driver.messages.values())
        or any(spec.on_connect or spec.on_close or spec.keepalive for spec in specs)
    )
