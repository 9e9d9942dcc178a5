"""Parser and checks for commands that start autonomous motion."""

from collections.abc import Mapping

from urc.config.node import Node, Problems
from urc.config.spelling_suggestions import did_you_mean
from urc.expressions import Template
from urc.model.driver import Command
from urc.model.sequence import RunStep, all_steps
from urc.model.values import Reading

__all__ = ["link_moves", "parse_moves", "refuse_moving", "runs_what_moves", "with_moving_steps"]


def parse_moves(part: Node, problems: Problems) -> tuple[bool, Template | None]:
    """Return whether a command starts autonomous motion, and the condition under ``moves``."""
    said = part.get("moves")
    if said is None or isinstance(said.data, bool):
        return bool(said and said.data), None
    return True, problems.expression(said)


def link_moves(problems: Problems, part: Node, command: Command) -> None:
    """Report each name under ``moves`` that is not an argument of the command."""
    condition = command.moves_if
    if condition is None:
        return
    for name in sorted(condition.names - command.arguments.keys()):
        problems.error(
            part.must("moves"),
            "unknown-name",
            f"{name!r} is not an argument of {command.name!r}",
            offset=condition.source.find(name),
            hint=did_you_mean(name, command.arguments, "arguments"),
        )


def runs_what_moves(command: Command, arguments: Mapping[str, Template | Reading]) -> bool:
    """Return whether a command with these arguments may start autonomous motion."""
    is_told = not any(isinstance(value, Template) for value in arguments.values())
    return command.moves_with(arguments) if is_told else command.moves


def with_moving_steps(commands: Mapping[str, Command]) -> dict[str, Command]:
    """Return all commands, with `moves` true for each sequence that starts motion."""
    found = dict(commands)

    def does(step: object) -> bool:
        if not isinstance(step, RunStep) or step.command not in found:
            return False
        command = found[step.command]
        return command.hold is not None or runs_what_moves(command, step.arguments)

    while True:
        more = [
            name
            for name, one in found.items()
            if not one.moves and any(map(does, all_steps(one.steps)))
        ]
        if not more:
            return found
        found |= {name: found[name]._replace(moves=True) for name in more}


def refuse_moving(
    problems: Problems,
    part: Node,
    command: Command,
    arguments: Mapping[str, Template | Reading],
) -> None:
    """Report a command that would start autonomous motion if `part` ran it automatically."""
    if runs_what_moves(command, arguments):
        problems.error(
            part,
            "wrong-command",
            f"{command.name!r} starts autonomous motion, so it must not run automatically",
            hint="run a command that does not start motion; only operators may start autonomous"
            " motion",
        )
