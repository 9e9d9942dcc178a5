"""`urc tokens`: manage the tokens of programs."""

import argparse
import time
from typing import TYPE_CHECKING

from urc.cli.error_report import Misuse
from urc.cli.identities import (
    add_actions,
    add_format,
    add_roles,
    ends_at,
    iso,
    local_time,
    record,
    remove,
    roles_in,
    roles_text,
    run_action,
    show,
    words_of,
)
from urc.cli.output import complain

if TYPE_CHECKING:
    from urc.access.store import AccessStore

EXAMPLE = "urc tokens add 'Night patrol' --role drive@cart --commands goto,dock --ends 30d"

_MOST_COMMANDS = 100
_LONGEST_COMMAND = 100


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command-line arguments: action, scope and end time."""
    add_actions(
        parser,
        _ACTIONS,
        "list; add NAME: print a new token, which URC never shows again; remove NAME",
    )
    add_roles(
        parser,
        "add: watch, drive, maintain or administer; drive@cart for one robot, drive@#lab for a"
        " tag; repeatable",
    )
    parser.add_argument(
        "--commands",
        metavar="NAMES",
        action="append",
        type=_commands,
        default=[],
        help="add: the only commands that the program may run, such as goto,dock"
        " (default: all commands of its role)",
    )
    parser.add_argument(
        "--ends",
        metavar="TIME",
        type=ends_at,
        default="90d",
        help="add: end of the token: 30d, 8h, 2027-01-31 or never (default: 90d)",
    )
    add_format(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the action."""
    return run_action(_ACTIONS, arguments)


def _list(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """List the programs with their roles, commands, end times and last use."""
    from urc.access.administration import overview

    words_of(arguments, "tokens")
    now = time.time()
    programs = overview(store, now, "program")
    rows = [
        {
            "id": one.principal.id,
            "name": one.principal.name,
            "roles": [str(grant) for grant in one.principal.grants],
            "commands": list(one.principal.commands) or None,
            "ends": iso(one.principal.ends_at),
            "is_valid": one.sign_ins > 0,
            "last_use": iso(one.used_at),
            "created": iso(one.principal.created_at),
        }
        for one in programs
    ]
    table = [
        (
            one.principal.name,
            roles_text(one.principal.grants),
            ", ".join(one.principal.commands) or "all commands",
            local_time(one.principal.ends_at) if one.sign_ins else "ended",
            local_time(one.used_at),
        )
        for one in programs
    ]
    head = ("NAME", "ROLES", "COMMANDS", "ENDS", "LAST USE")
    return show(
        rows,
        [head, *table],
        arguments,
        "no tokens yet: 'urc tokens add NAME --role watch' adds a token",
    )


def _add(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Add a program, and print its token."""
    (name,) = words_of(arguments, "tokens", "NAME")
    roles = roles_in(arguments.roles)
    if not roles:
        raise Misuse("'urc tokens add' requires --role")
    commands = tuple(dict.fromkeys(one for each in arguments.commands for one in each))
    if len(commands) > _MOST_COMMANDS:
        raise Misuse(f"--commands: expected at most {_MOST_COMMANDS}, found {len(commands)}")
    now, end = time.time(), arguments.ends
    with store.transaction():
        program = store.add("program", name, roles, now=now, commands=commands, ends_at=end)
        _, token = store.open_sign_in(program.id, "token", now=now, ends_at=end)
    scope = f"{roles_text(roles)}; {', '.join(commands) or 'all commands'}"
    record(store, "tokens add", name=program.name, scope=scope, ends=iso(end))
    print(token)
    complain(
        f"the token of {program.name} ({scope}) ends: {local_time(end)};"
        " store it now, because URC never shows it again"
    )
    return 0


def _remove(store: "AccessStore", arguments: argparse.Namespace) -> int:
    """Remove a program and its token."""
    return remove(store, "program", arguments, "tokens", ": its token is no longer valid")


def _commands(text: str) -> list[str]:
    found = [one.strip() for one in text.split(",")]
    for one in found:
        if not one or len(one) > _LONGEST_COMMAND or not one.isprintable() or " " in one:
            raise argparse.ArgumentTypeError(
                f"expected command names such as goto,dock, found {text[:60]!r}"
            )
    return found


_ACTIONS = {"list": _list, "add": _add, "remove": _remove}
