"""Checks sequences: the names in their steps, and cycles."""

from collections.abc import Iterator

from urc.config.autonomous_motion import refuse_moving
from urc.config.command_roles import link_role
from urc.config.link.cycles import cycle_from
from urc.config.link.flow import (
    Linker,
    find_command,
    link_arguments,
    link_refusals,
    link_requirements,
    refuse_two_person,
)
from urc.config.node import Node
from urc.expressions import COUNTERS, NONCE, NOW, Template
from urc.model import sequence
from urc.model.driver import Driver

__all__ = ["link_sequences", "steps_of"]


def steps_of(part: Node) -> Node:
    """Return the list of steps of the sequence at `part`, which may be a mapping."""
    return part.must("steps") if isinstance(part.data, dict) else part


def link_sequences(linker: Linker, part: Node) -> None:
    """Check the steps of all sequences and transports in the driver at `part`."""
    commands = part.named("commands")
    for name, inner in part.named("sequences").items():
        if name in commands:
            linker.problems.error(
                inner,
                "duplicate-name",
                f"a command also has the name {name!r}",
                key=True,
                hint="give each of them its own name",
            )
            continue
        command = linker.driver.commands[name]
        if isinstance(inner.data, dict):
            link_requirements(linker, inner, command)
            link_role(linker.problems, inner, command)
        _Walk(linker, is_named=True).steps(steps_of(inner), command.steps)
        cycle = cycle_from(name, lambda one: _runs(one, linker.driver))
        if cycle:
            linker.problems.error(
                inner,
                "circular-run",
                f"{name!r} runs itself: {' → '.join(cycle)}",
                key=True,
                hint="write repeat: [ … ] with 'times' for a loop",
            )
    for name, inner in part.named("transports").items():
        spec = linker.driver.transports[name]
        for key, steps in (("on_connect", spec.on_connect), ("on_close", spec.on_close)):
            if steps:
                linker.transport(inner, "type", name)  # these steps use the transport
                is_late = key != "on_connect"
                _Walk(linker, is_named=False, is_late=is_late).steps(inner.must(key), steps)


class _Walk:
    """Checks the steps of one sequence in order; earlier steps define names for later steps."""

    def __init__(self, linker: Linker, *, is_named: bool, is_late: bool = True) -> None:
        self._linker = linker
        self._is_named = is_named
        self._is_late = is_late
        """Whether the steps run after the login and may use its values."""
        self._known: set[str] = set(linker.driver.signals)

    def steps(self, part: Node, steps: tuple[sequence.Step, ...]) -> None:
        for inner, step in zip(part.items(), steps, strict=True):
            self._step(inner, step)

    def _step(self, part: Node, step: sequence.Step) -> None:
        match step:
            case sequence.SendStep():
                self._transport(part, "to", step.transport)
                known = {*self._known, COUNTERS, NONCE, NOW, *self._learnt(step.transport)}
                self._linker.templates(part.must("send"), step.send, known)
            case sequence.ExpectStep():
                self._expect(part, step)
                self._otherwise(part, step.otherwise)
            case sequence.PromptStep():
                self._transport(part, "from", step.transport)
                self._must_last(part.must("prompt"), step.transport)
                self._otherwise(part, step.otherwise)
            case sequence.UntilStep():
                self._template(part.must("wait").must("until"), step.condition)
                self._otherwise(part, step.otherwise)
            case sequence.RepeatStep():
                self._repeat(part, step)
            case sequence.RunStep():
                self._run(part, step)
            case sequence.SetStep():
                for name, inner in part.must("set").entries().items():
                    self._linker.field(inner, name, {"key": True})
                    self._template(inner, step.values.get(name))
            case sequence.IfStep():
                self._template(part.must("if"), step.condition)
                then = part.get("then")
                if then is not None:
                    self.steps(then, step.then)
                self._otherwise(part, step.otherwise or None)
            case sequence.FailStep(text):
                self._template(part.must("fail"), text)

    def _expect(self, part: Node, step: sequence.ExpectStep) -> None:
        self._transport(part, "from", step.transport)
        inner = part.must("expect")
        self._must_last(inner, step.transport)
        if isinstance(inner.data, dict):
            self._linker.fields(inner, step.read)
            link_refusals(self._linker, inner, step.faults)
        else:
            for name in step.read.fields:
                offset = str(inner.data).find(f"<{name}>") + 1
                self._linker.field(inner, name, {"offset": offset, "length": len(name)})
        self._known |= {name for name in step.read.fields if name.startswith("_")}

    def _repeat(self, part: Node, step: sequence.RepeatStep) -> None:
        self.steps(part.must("repeat"), step.body)
        if step.until is not None:
            self._template(part.must("until"), step.until)
        self._otherwise(part, step.otherwise)
        commands = self._linker.driver.commands
        for one in sequence.all_steps(step.body):
            if isinstance(one, sequence.RunStep) and one.command in commands:
                loops = _loops(one.command, self._linker.driver)
                if loops:
                    self._linker.problems.error(
                        part,
                        "too-many-steps",
                        f"{loops!r} has a loop inside this loop, so the number of steps is not"
                        " limited",
                        at="repeat",
                        key=True,
                        hint="use a loop in only one of the two sequences",
                    )

    def _run(self, part: Node, step: sequence.RunStep) -> None:
        command = find_command(self._linker, part.must("run"), step.command)
        given = part.named("args")
        for name, inner in given.items():
            self._template(inner, step.arguments.get(name))
        if command is None:
            return
        link_arguments(self._linker.problems, part, command, given, "run")
        if not self._is_named:
            refuse_two_person(self._linker, part.must("run"), command)
            refuse_moving(self._linker.problems, part.must("run"), command, step.arguments)
        if command.reply is not None:
            self._known |= command.reply.names

    def _learnt(self, transport: str) -> frozenset[str]:
        """Return the names that a transport's login defines; none for steps of the login."""
        driver = self._linker.driver
        return (
            driver.learnt(transport)
            if self._is_late and transport in driver.transports
            else frozenset()
        )

    def _otherwise(self, part: Node, steps: tuple[sequence.Step, ...] | None) -> None:
        inner = part.get("else")
        if inner is not None and steps:
            self.steps(inner, steps)

    def _template(self, part: Node, template: object) -> None:
        if isinstance(template, Template):
            self._linker.template(part, template, self._known)

    def _transport(self, part: Node, key: str, name: str) -> None:
        if self._is_named:
            self._linker.transport(part, key, name)

    def _must_last(self, part: Node, transport: str) -> None:
        """Report a step that waits for a frame although each request opens a connection."""
        spec = self._linker.driver.transports.get(transport)
        if self._is_named and spec is not None and spec.connection == "per_request":
            self._linker.problems.error(
                part,
                "no-connection",
                f"{transport!r} opens a connection for each request, so no connection"
                " stays open between two steps",
                hint="run a command with a reply, or make the connection persistent",
            )


def _loops(start: str, driver: Driver) -> str:
    """Return the first sequence with a loop among `start` and the sequences that it runs, or ""."""
    waiting, seen = [start], {start}
    while waiting:
        name = waiting.pop(0)
        if any(isinstance(step, sequence.RepeatStep) for step in _steps_in(name, driver)):
            return name
        found = set(_runs(name, driver)) - seen
        seen |= found
        waiting += sorted(found)
    return ""


def _runs(name: str, driver: Driver) -> list[str]:
    """Return the names of the commands and sequences that the sequence `name` runs."""
    return [step.command for step in _steps_in(name, driver) if isinstance(step, sequence.RunStep)]


def _steps_in(name: str, driver: Driver) -> Iterator[sequence.Step]:
    command = driver.commands.get(name)
    return sequence.all_steps(command.steps if command else ())
