"""Bounds of a command: its maximum duration and the transports that it uses.

Pure. Every wait in an engine has a timeout. The maximum duration of a command is the sum of all its
timeouts.
"""

from collections.abc import Callable, Mapping
from typing import Final

from urc.model.driver import Command, Driver, Reply, TransportSpec
from urc.model.exchange import RESENDS, ProvisionalReplies
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
"""Maximum total duration of ``on_close``, in seconds."""


def queue_limit_s(spec: TransportSpec, reply_s: float | None) -> float:
    """Return the maximum time for which a request waits in the queue, in seconds.

    Args:
        spec: transport for the request.
        reply_s: timeout of the first reply in seconds; None means the transport's default timeout.
    """
    answer_s = spec.timeouts.reply_s if reply_s is None else reply_s
    steps_s = _steps_s(spec.on_connect, lambda step: _step_s(step, spec))
    if spec.timeouts.on_connect_s is not None:
        steps_s = min(steps_s, spec.timeouts.on_connect_s)
    return spec.timeouts.connect_s + 2 * answer_s + steps_s


def longest_s(driver: Driver, name: str) -> float:
    """Return the maximum duration of the command or sequence `name`, in seconds."""
    command = driver.commands.get(name)
    return 0.0 if command is None else _command_s(command, driver, frozenset())


def calm_s(driver: Driver) -> float:
    """Return the minimum time from a frame or command to a deadline that it sets, in seconds.

    The deadlines of replies, polls and stale connections count, but those of sequences and framing
    timeouts do not. The result is 0 if the minimum is unknown.
    """
    if any(one.verify or one.rate_per_s for one in driver.commands.values()):
        return 0.0
    if any(
        one.limits.is_timed or one.deadband or one.debounce_s for one in driver.signals.values()
    ):
        return 0.0
    if any(one.type == "transform_tree" for one in driver.signals.values()):
        return 0.0  # the next sample of the tree may be nearly due when a message arrives
    if any(spec.keepalive or spec.min_gap_s for spec in driver.transports.values()):
        return 0.0  # a gap may be nearly over when the next request arrives
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
            return 0.0  # a sequence may have waits of its own
    return min(waits, default=0.0)


def _command_s(command: Command, driver: Driver, outer: frozenset[str]) -> float:
    if command.name in outer:
        return 0.0  # loaded sequences never run themselves; hand-built sequences might
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
    """Return the maximum duration of `steps` in seconds, with all repetitions and both branches."""
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
    # A retransmitted request starts again at its first reply.
    stages_s = _stages_s(reply, spec) * (times if reply.is_asked_again else 1)
    return times * once_s + waits_s + stages_s


def _stages_s(reply: Reply, spec: TransportSpec) -> float:
    return sum(_answer_s(one.timeout_s, spec, one.asides) for one in reply.stages)


def _answer_s(timeout_s: float | None, spec: TransportSpec, asides: ProvisionalReplies) -> float:
    busy_s = asides.extend_s if asides.extend is not None else 0.0
    return max(spec.timeouts.reply_s if timeout_s is None else timeout_s, busy_s)


def _line_of(step: Step, transports: Mapping[str, TransportSpec]) -> TransportSpec | None:
    if isinstance(step, (SendStep, ExpectStep, PromptStep)):
        return transports[step.transport]
    return None


def _step_s(step: Step, spec: TransportSpec | None) -> float:
    """Return the maximum duration of one step in seconds, excluding branches and commands."""
    if isinstance(step, WaitStep):
        return step.seconds
    if isinstance(step, UntilStep):
        return step.timeout_s
    if spec is None:
        return 0.0
    if isinstance(step, SendStep):
        return spec.timeouts.connect_s + 2 * spec.timeouts.reply_s
    if isinstance(step, (ExpectStep, PromptStep)):
        return _answer_s(step.timeout_s, spec, ProvisionalReplies())
    return 0.0


def lines_of(name: str, driver: Driver) -> frozenset[str]:
    """Return the names of the transports that a command and its nested commands use."""
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
    """Return whether a driver has conditions or steps that may use signals."""
    specs = driver.transports.values()
    return (
        any(
            one.requires or one.verify or one.steps or one.confirm
            for one in driver.commands.values()
        )
        or any(poll.when is not None for poll in driver.polls)
        or any(
            one.acknowledge is not None or one.log is not None for one in driver.messages.values()
        )
        or any(spec.on_connect or spec.on_close or spec.keepalive for spec in specs)
    )
