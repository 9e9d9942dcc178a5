"""What a command involves: how long it may take at most, and over which lines.

Every wait of an engine has an end, and here they are added up.

Floor 3, pure.
"""

from collections.abc import Mapping
from typing import Final

from urc.model.driver import Command, Driver, Reply, TransportSpec
from urc.model.flow import ExpectStep, PromptStep, RunStep, SendStep, Step, WaitStep, all_steps

__all__ = ["GOOD_BYE_S", "lines_of", "longest_s", "queue_limit_s"]

GOOD_BYE_S: Final = 2.0
"""What ``on_close`` may take in all."""


def queue_limit_s(spec: TransportSpec, reply_s: float | None) -> float:
    """Return how long a request may wait to be sent.

    Args:
        spec: the line.
        reply_s: how long its first answer may take; None when nothing answers it.
    """
    answer_s = spec.timeouts.reply_s if reply_s is None else reply_s
    steps_s = sum(_step_s(step, spec) for step in all_steps(spec.on_connect))
    return spec.timeouts.connect_s + 2 * answer_s + steps_s


def longest_s(driver: Driver, name: str) -> float:
    """Return the time in which the command or sequence `name` is over, whatever happens."""
    command = driver.commands.get(name)
    return 0.0 if command is None else _command_s(command, driver, frozenset())


def _command_s(command: Command, driver: Driver, outer: frozenset[str]) -> float:
    if command.name in outer:
        return 0.0  # no sequence runs itself; whoever builds one by hand gets no endless loop
    within_s = command.verify.within_s if command.verify is not None else 0.0
    if not command.steps:
        return _exchange_s(command, driver.transports[command.transport]) + within_s
    outer |= {command.name}
    total_s = within_s
    for step in all_steps(command.steps):
        if isinstance(step, RunStep):
            inner = driver.commands.get(step.command)
            total_s += _command_s(inner, driver, outer) if inner is not None else 0.0
        else:
            total_s += _step_s(step, _line_of(step, driver.transports))
    return total_s


def _exchange_s(command: Command, spec: TransportSpec) -> float:
    reply = command.reply
    if reply is None:
        return queue_limit_s(spec, None)
    first_s = _answer_s(reply.timeout_s, spec)
    # Before it is sent again, the late answer is waited for as long as the answer was.
    once_s = queue_limit_s(spec, first_s) + first_s
    again_s = once_s + first_s
    return once_s + command.retries * again_s + _stages_s(reply, spec)


def _stages_s(reply: Reply, spec: TransportSpec) -> float:
    return sum(_answer_s(one.timeout_s, spec) for one in reply.stages)


def _answer_s(timeout_s: float | None, spec: TransportSpec) -> float:
    return spec.timeouts.reply_s if timeout_s is None else timeout_s


def _line_of(step: Step, transports: Mapping[str, TransportSpec]) -> TransportSpec | None:
    if isinstance(step, (SendStep, ExpectStep, PromptStep)):
        return transports[step.transport]
    return None


def _step_s(step: Step, spec: TransportSpec | None) -> float:
    """Return the longest time of one step, its branches and what it runs aside."""
    if isinstance(step, WaitStep):
        return step.seconds
    if spec is None:
        return 0.0
    if isinstance(step, SendStep):
        return spec.timeouts.connect_s + 2 * spec.timeouts.reply_s
    if isinstance(step, (ExpectStep, PromptStep)):
        return _answer_s(step.timeout_s, spec)
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
