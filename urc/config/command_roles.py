"""Roles of sequences: a sequence needs the roles of all commands that it runs."""

from collections.abc import Mapping

from urc.config.node import Node, Problems
from urc.model.driver import Command
from urc.model.role import Role, includes
from urc.model.sequence import RunStep, all_steps

__all__ = ["link_role", "with_roles_of_steps"]


def with_roles_of_steps(commands: Mapping[str, Command]) -> dict[str, Command]:
    """Return all commands, with each sequence's role raised to the highest role of its commands."""
    found = dict(commands)
    while True:
        raised = {
            name: one._replace(role=role)
            for name, one in found.items()
            if (role := _highest(one, found)) != one.role
        }
        if not raised:
            return found
        found |= raised


def link_role(problems: Problems, part: Node, command: Command) -> None:
    """Report a sequence whose declared role is lower than the role that one of its commands needs.

    Args:
        problems: collects the reported problem.
        part: the sequence's mapping.
        command: the sequence as a command, with the highest role of its commands.
    """
    declared = part.text("role", command.role)
    if declared != command.role:
        problems.error(
            part,
            "role-too-low",
            f"a command in this sequence needs the role {command.role!r}",
            at="role",
            hint=f"write role: {command.role}, or remove 'role'",
        )


def _highest(command: Command, commands: Mapping[str, Command]) -> Role:
    role = command.role
    for step in all_steps(command.steps):
        if isinstance(step, RunStep) and step.command in commands:
            other = commands[step.command].role
            role = other if includes(other, role) else role
    return role
